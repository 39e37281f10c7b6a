"""Coupled coil groups: analytic solutions, a solver that knows no step, flux, energy, faults, messages."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from spheretwin import scenario as scenarios
from spheretwin.electronics.coil import OPEN, SHORTED
from spheretwin.electronics.coil_coupling import TOLERANCE_A
from spheretwin.electronics.drive_chain import DriveChain, advance, begin, fill_drive
from spheretwin.electronics.drive_section import ResolvedDrive
from spheretwin.models.actuator import load
from spheretwin.models.inductance import mutual_inductance
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.session import Session

R, L, W, UP, DOWN = 1.3, 0.9e-3, 2 * np.pi * 2000, 24 - 4.8, -24 + 4.6
MUTUAL_H = mutual_inductance(load())
GROUPS = len(MUTUAL_H)
REMAINDER_V = np.abs(MUTUAL_H).sum(axis=1).max() / 5e-4 * TOLERANCE_A
"""Error of the mean induced voltage that the iteration leaves in one part of a step."""


def chain_of(mutual_H, step_s, **changed):
    fields = {
        "supply_V": 24.0, "drop_up_V": 4.8, "drop_down_V": 4.6, "resistance_ohm": R, "inductance_H": L,
        "current_limit_A": 1e3, "coil_coupling": 1.0, "resistance_per_K": 0.0, "heat_capacity_J_K": 60.0,
        "thermal_resistance_K_W": 4.0,
    }  # fmt: skip
    groups = GROUPS if mutual_H is None else len(mutual_H)
    section = ResolvedDrive(**fields | changed)
    setting = section, step_s, 1, 0, False, False, mutual_H
    return DriveChain.filled(fill_drive, *setting, groups=groups, delays=8)[0]


class Steps:
    """Currents of a chain at rest poses: a back-EMF enters by a matrix that turns rates into it."""

    def __init__(self, chain, current):
        self.chain, self.current, self.groups = chain, np.array(current, dtype=float), len(current)
        self.mean = np.empty(self.groups)

    def take(self, command, emf=None):
        """Advance by one step; return charge, copper loss and electrical work of each group."""
        G = np.zeros((3, self.groups))
        G[0] = 0.0 if emf is None else emf
        none, ones, rates = np.zeros(0), np.ones(self.groups), np.array([1.0, 0, 0])
        begin(self.chain, command, 0, none)
        advance(self.chain, 0, np.zeros(3), rates, G, ones, none, self.current, self.mean)
        flow = self.chain.flow
        charge = self.mean * self.chain.amplifier.whole.step_s
        return charge, flow.copper_J.copy(), flow.work_J.copy()


def run(mutual_H, duration_s, steps, current, command, emf=None, **changed):
    """Currents, charge, copper loss and work after a duration in a number of steps."""
    taken = Steps(chain_of(mutual_H, duration_s / steps, **changed), current)
    sums = sum(np.array(taken.take(command, emf)) for _ in range(steps))
    return taken.current, *sums


def solved(mutual_H, duration_s, current, command, emf):
    """The same by scipy, without steps: an amplifier sets the voltage for di/dt = w (r - i), if it can."""
    groups = len(current)
    inductance = L * np.eye(groups) + mutual_H

    def slope(t, state):
        i = state[:groups]
        rate = W * (command - i)
        for _ in range(60):  # a voltage at its limit changes all others; the coupling contracts
            volts = np.clip(R * i + emf + L * W * (command - i) + mutual_H @ rate, DOWN, UP)
            rate = (volts - R * i - emf - mutual_H @ rate) / L
        np.testing.assert_allclose(inductance @ rate, volts - R * i - emf, atol=1e-9)
        return np.concatenate([rate, i, R * i**2, volts * i])

    start = np.concatenate([current, np.zeros(3 * groups)])
    tolerances = {"rtol": 1e-9, "atol": 1e-12, "max_step": duration_s / 400}
    return solve_ivp(slope, (0, duration_s), start, **tolerances).y[:, -1].reshape(4, groups)


def orders(errors):
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def test_all_groups_at_limits_are_the_matrix_exponential():
    generator = np.random.default_rng(3)
    volts = generator.choice([UP, DOWN], GROUPS)
    emf, start = generator.normal(size=GROUPS), generator.normal(size=GROUPS)
    own_H, resistance_ohm = np.linspace(1.0, 0.8, GROUPS) * L, np.linspace(1.0, 1.6, GROUPS) * R
    coils = {"resistance_ohm": tuple(resistance_ohm), "inductance_H": tuple(own_H)}
    duration, errors, command = 5e-4, [], np.sign(volts) * 1e3
    last = (volts - emf) / resistance_ohm
    decay = expm(-duration * np.linalg.inv(np.diag(own_H) + MUTUAL_H) @ np.diag(resistance_ohm))
    expected = last + decay @ (start - last)
    for steps in (1, 4, 8, 16):
        current, *_ = run(MUTUAL_H, duration, steps, start, command, emf, **coils)
        errors.append(np.abs(current - expected).max())
    uncoupled, *_ = run(np.zeros_like(MUTUAL_H), duration, 1, start, command, emf, **coils)
    # At the step of the plant, the error is below a fifteenth of the effect of the coupling.
    assert errors[0] < np.abs(uncoupled - expected).max() / 15
    np.testing.assert_allclose(orders(errors)[1:], 2, atol=0.1)


@pytest.mark.release("1.2 s; groups at limits and followers have exact solutions")
def test_groups_that_reach_and_leave_limits_converge_to_a_solver_without_steps():
    generator = np.random.default_rng(5)
    groups = [0, 1, 2, 6, 12, 13]
    mutual = MUTUAL_H[np.ix_(groups, groups)]
    start, emf = generator.normal(size=6), generator.normal(size=6)
    command, duration, errors = np.array([3.0, -2.5, 0.5, 1.5, -4.0, 0.0]), 5e-4, []
    expected = solved(mutual, duration, start, command, emf)
    scales = np.abs(expected).max(axis=1, keepdims=True)
    results = [np.array(run(mutual, duration, steps, start, command, emf)) for steps in (1, 8, 16, 32)]
    uncoupled = np.array(run(0 * mutual, duration, 1, start, command, emf))
    # Currents, charges, copper losses and work, as shares of the largest.
    effect = np.abs((uncoupled - expected) / scales).max(axis=1)
    errors = np.array([np.abs((result - expected) / scales).max(axis=1) for result in results])
    assert np.all(effect[1:] > 9e-3)
    assert np.all(errors[0] < 0.3 * effect)
    assert np.all(errors[-1] < 1e-5)
    np.testing.assert_allclose(orders(errors[1:, 1:].max(axis=1)), 2, atol=0.2)


def test_followers_keep_their_currents_and_need_the_induced_voltage():
    """All currents are known: i = r + d exp(-w t), and the induced voltage is -w M d exp(-w t)."""
    generator = np.random.default_rng(1)
    start, command, emf = generator.normal(size=(3, GROUPS)) * 0.3
    _, _, copper_0, work_0 = run(np.zeros_like(MUTUAL_H), 5e-4, 1, start, command, emf)
    d, left = start - command, np.exp(-W * 5e-4)
    expected = -(MUTUAL_H @ d) * (command * (1 - left) + d * (1 - left**2) / 2)
    errors = []
    for steps in (1, 4, 8, 16):
        current, _, copper, work = run(MUTUAL_H, 5e-4, steps, start, command, emf)
        np.testing.assert_allclose(current, command + d * left, rtol=0, atol=1e-15)
        np.testing.assert_allclose(copper, copper_0, rtol=1e-13)
        errors.append(np.abs(work - work_0 - expected).max())
    assert errors[0] < np.abs(expected).max() / 2
    np.testing.assert_allclose(orders(errors)[1:], 2, atol=0.1)


@pytest.mark.parametrize("scale", [10.0, 50.0])
def test_flux_linkage_changes_by_the_voltage_to_the_last_digit(scale):
    """Groups that stay at a limit: the voltage is known at each time, and v - R i - e is the flux."""
    generator = np.random.default_rng(2)
    steps = Steps(chain_of(MUTUAL_H, 5e-4), np.zeros(GROUPS))
    inductance = L * np.eye(GROUPS) + MUTUAL_H
    at_limit = 0
    for _ in range(50):
        command, emf = scale * generator.normal(size=GROUPS), generator.normal(size=GROUPS)
        before = steps.current.copy()
        charge, _, work = steps.take(command, emf)
        stays = steps.chain.flow.voltage_limited_s > 5e-4 * (1 - 1e-12)
        # A group that goes from one limit to the other has another voltage on average.
        stays &= np.abs(np.abs(work) - UP * np.abs(charge)) < 0.02 * np.abs(work)
        volts = work[stays] / charge[stays]
        flux = (inductance @ (steps.current - before))[stays]
        expected = (volts - emf[stays]) * 5e-4 - R * charge[stays]
        np.testing.assert_allclose(flux, expected, rtol=0, atol=2 * REMAINDER_V * 5e-4)
        at_limit += stays.sum()
    assert at_limit > 100


def test_back_emf_takes_the_power_of_the_torque_to_the_last_digit():
    generator = np.random.default_rng(4)
    chain = chain_of(MUTUAL_H, 5e-4)
    G, gain = generator.normal(size=(3, GROUPS)) * 0.05, generator.uniform(0.8, 1.2, GROUPS)
    q, qdot = generator.normal(size=3) * 0.3, generator.normal(size=3) * 5
    command, current, mean = generator.normal(size=GROUPS), np.zeros(GROUPS), np.empty(GROUPS)
    begin(chain, command, 0, np.zeros(0))
    advance(chain, 0, q, qdot, G, gain, np.zeros(0), current, mean)
    electrical, mechanical = chain.coupling.own_emf @ mean, (G @ (gain * mean)) @ (rate_jacobian(q) @ qdot)
    assert electrical == pytest.approx(mechanical, rel=1e-14)


@pytest.mark.parametrize("contact", [OPEN, SHORTED])
def test_shorted_groups_conserve_the_flux_when_another_opens(contact):
    """With hardly any resistance, a closed circuit keeps its flux linkage."""
    steps = Steps(chain_of(MUTUAL_H, 5e-4, resistance_ohm=1e-3), np.linspace(-1, 2, GROUPS))
    contacts = steps.chain.coil.contact
    contacts[:], contacts[4] = SHORTED, contact
    inductance, before = L * np.eye(GROUPS) + MUTUAL_H, steps.current.copy()
    steps.take(np.zeros(GROUPS))
    flux = inductance @ (steps.current - before)
    closed = np.arange(GROUPS) != 4
    # The loss of 2 A in 1 mohm over half a millisecond: 1e-6 Vs, of a flux of 1.8e-3 Vs.
    assert np.abs(flux[closed]).max() < 1.1e-6
    assert (abs(flux[4]) < 1.1e-6) == (contact == SHORTED)
    if contact == OPEN:
        assert steps.current[4] == 0
        neighbour = np.argmin(MUTUAL_H[4])
        jump = (steps.current - before)[neighbour]
        assert jump == pytest.approx(MUTUAL_H[4, neighbour] / L * before[4], rel=0.25)


def test_share_scales_the_coupling():
    half, whole = (chain_of(MUTUAL_H, 5e-4, coil_coupling=share).coupling.mutual_H for share in (0.5, 1.0))
    np.testing.assert_array_equal(half, whole / 2)
    np.testing.assert_array_equal(whole, MUTUAL_H)


FIELDS = {"hardware": "prototype", "plant.engine": "lagrangian", "duration": 0.2}


@pytest.mark.release("3.5 s; the other tests of this file have the coupled currents")
@pytest.mark.uncompiled
def test_a_run_has_the_coupling_of_its_model():
    with Session(scenarios.load("nutation", FIELDS)) as session:
        first = session.advance(60)
    # As good as none, and the same code.
    with Session(scenarios.load("nutation", FIELDS | {"drive.coil_coupling": 1e-9})) as session:
        plain = session.advance(60)
    with Session(scenarios.load("nutation", FIELDS | {"drive.coil_coupling": 0.0})) as session:
        session.set("drive.coil_coupling", 1.0)
        assert session.advance(60).values.tobytes() == first.values.tobytes()
    difference = np.abs(first["coil_power_W"] - plain["coil_power_W"])
    assert 1e-3 < difference.max() / np.abs(plain["coil_power_W"]).max() < 0.5
