"""End stops: exact bounce, rest under a load, energy, order, both engines, and no trace of them when off."""

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from scipy.optimize import brentq

from spheretwin import scenario as scenarios
from spheretwin.models.base.columns import Columns
from spheretwin.models.base.errors import InputError
from spheretwin.models.lagrangian import inertia_matrix
from spheretwin.plant.bristle_friction import (
    BristleFriction,
    StictionSection,
    apply_bristles,
    begin_bristles,
    fill_bristles,
)
from spheretwin.plant.cable import CableSection
from spheretwin.plant.end_stops import EndStops, EndStopsSection, fill_end_stops
from spheretwin.session import Session
from tests.twin.passive_cases import STILL
from tests.twin.plant.motions import NONE, STEP_s, friction, ideal_rotor, motion, on_gamma, steps
from tests.twin.plant.test_bristle_friction import three
from tests.twin.plant.test_friction import ideal

ON = EndStopsSection(on=True)
# Hinge γ has no end in the shipped model; upright and alone it has the inertia J3, and exact solutions.
RANGE_rad = np.array([[-1.4, 1.4], [-1.4, 1.4], [-0.5, 0.5]])
CONTACT_rad = 0.5 - ON.travel_rad


def stopped(actuator, section=ON, step_s=STEP_s):
    return bristles_of(actuator, section, step_s, StictionSection(), (0.0, 0.0, 0.0))


def bristles_of(actuator, section, step_s, stiction, coulomb):
    rows = BristleFriction.zeros()
    fill_end_stops(rows["stops"], section, RANGE_rad, actuator.inertia, step_s)
    fill_bristles(rows, stiction, coulomb, CableSection(), actuator.inertia, step_s)
    return rows[0]


def spin(actuator, duration_s, rate, load=0.0, section=ON, step_s=STEP_s):
    """Angle and rate of hinge γ before each step."""
    torque = np.tile(on_gamma(load), (round(duration_s / step_s), 1))
    rotor = ideal_rotor(actuator, step_s)
    q, qdot, _ = motion(rotor, stopped(actuator, section, step_s), torque, NONE, on_gamma(rate))
    assert not np.any(q[:, :2])
    return q[:, 2], qdot[:, 2]


def bounce(actuator, rate, section=ON):
    """Time of the contact, largest penetration and rate after it: the damped oscillation up to no torque."""
    natural = np.sqrt(section.stiffness_Nm_rad / actuator.inertia[2])
    damped, decay = natural * np.sqrt(1 - section.damping_ratio**2), section.damping_ratio * natural

    def penetration(t):
        return rate / damped * np.exp(-decay * t) * np.sin(damped * t)

    def speed(t):
        return rate * np.exp(-decay * t) * (np.cos(damped * t) - decay / damped * np.sin(damped * t))

    def pull(t):
        return natural**2 * penetration(t) + 2 * decay * speed(t)

    end = brentq(pull, np.pi / 2 / damped, np.pi / damped)
    turn = np.arctan2(damped, decay) / damped
    return end, penetration(turn), speed(end)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_bounce_is_the_exact_one_of_a_damped_spring(actuator, side):
    rate, sizes, errors = 10.0, np.array([5e-4, 2.5e-4, 1.25e-4, 6.25e-5]), []
    _, depth, after = bounce(actuator, rate)
    for h in sizes:
        q, qdot = spin(actuator, 0.06, side * rate, section=ON, step_s=h)
        errors.append(abs(side * qdot[-1] - after))
        assert np.all(np.abs(q) < 0.5)
        # The sample nearest to the turning point is half a step away from it: v h / 2 at no rate, h² a / 8.
        assert CONTACT_rad + depth - np.abs(q).max() < 2e-3 * depth * (h / 5e-4) + 1e-4
    # Each step has the exact momentum of the damper; the spring has (natural h)² / 12, and the end of the
    # contact falls within a step.
    natural = np.sqrt(ON.stiffness_Nm_rad / actuator.inertia[2])
    assert np.all(errors < (natural * sizes) ** 2 * rate / 6), errors
    assert errors[-1] < 0.1 * errors[0], errors


def test_without_damping_a_bounce_returns_the_rate(actuator):
    """The discrete gradient conserves energy: what is lost is rounding."""
    q, qdot = spin(actuator, 0.2, 8.0, section=ON.model_copy(update={"damping_ratio": 0.0}))
    assert np.abs(q).max() > CONTACT_rad + 5e-3
    assert abs(qdot[-1]) == pytest.approx(8.0, rel=1e-10)


def test_a_loaded_rotor_comes_to_rest_at_the_limit(actuator):
    load = 0.05
    q, qdot = spin(actuator, 20.0, 0.0, load=load)
    rest = CONTACT_rad + load / ON.stiffness_Nm_rad
    # Bounces end after the sum of a geometric series; then the oscillation decays with 1 / (0.3 · 850 rad/s).
    assert np.abs(q[-1000:] - rest).max() < 1e-12
    assert np.abs(qdot[-1000:]).max() < 1e-10


pose = st.floats(-1.45, 1.45)


@pytest.mark.release("1.2 s; test_a_bounce_is_the_exact_one_of_a_damped_spring is exact")
@given(
    st.tuples(pose, pose, st.floats(-0.55, 0.55)).map(np.array), three, st.floats(-3, 2), st.floats(0, 6),
    st.floats(0, 10), st.floats(-6, -2), st.booleans(),
)  # fmt: skip
@example(np.array([1.38, 1.39, 0.48]), np.array([1.0, -1.0, 1.0]), 2.0, 6.0, 0.3, -3.3, True)
def test_a_contact_never_adds_energy_and_never_pulls(
    actuator, q, direction, speed, stiffness, ratio, step, sticks
):
    """A step in which no hinge moves from stop to stop; at β = 1.4 rad α has a 30th of its inertia."""
    h, qdot = 10**step, 10**speed * direction
    section = ON.model_copy(update={"stiffness_Nm_rad": 10**stiffness, "damping_ratio": ratio})
    bristles = bristles_of(actuator, section, h, StictionSection(on=sticks), (2e-3, 2e-3, 2e-3))
    stops = bristles.stops
    after_q, after = q + h * qdot, qdot.copy()  # of a rotor without torque, and with constant inertia
    begin_bristles(bristles, q, q, qdot, np.zeros(3))
    apply_bristles(bristles, ideal(actuator.inertia), q, qdot, qdot, after_q, after)
    assume(np.all(np.abs(after_q - q) < np.ptp(stops.contact_rad, axis=1)))
    M = inertia_matrix(q, actuator.inertia)

    def energy(rates, angles):
        beyond = angles - np.clip(angles, *stops.contact_rad.T)
        return 0.5 * rates @ M @ rates + 0.5 * section.stiffness_Nm_rad * np.sum(beyond**2)

    springs = 0.5 * np.sum(bristles.stiffness_Nm_rad * bristles.deflection_rad**2)
    # The iteration ends at 1e-13 of the largest rate; the condition of the matrix is up to 140, and stiff
    # springs multiply an angle's rounding.
    rounding = 1e-9 * energy(qdot, q) + 1e-9 * section.stiffness_Nm_rad * (h * np.abs(qdot).max()) ** 2
    assert energy(after, after_q) + springs <= energy(qdot, q) + rounding + 1e-300
    # Inwards, or nothing.
    assert np.all(stops.torque_q * np.sign(q + after_q) <= 0)
    momentum = M @ (after - qdot) - h * (stops.torque_q - bristles.torque_q.sum(axis=0))
    impedance = h * section.stiffness_Nm_rad * h + stops.damping_Nm_s.max()
    scale = np.abs(M) @ (np.abs(after) + np.abs(qdot)) + h * np.abs(stops.torque_q)
    assert np.all(np.abs(momentum) <= 1e-9 * scale + 1e-11 * impedance * np.abs([after, qdot]).max() + 1e-300)


FREE = STILL | {
    "trajectory.shape": "hold",
    "manual.currents_A": [0.0] * 18,
    "plant.initial_rad": [0.4, -0.3, 0.2],
    "plant.initial_rad_s": [6.0, -5.0, 2.0],
}


@pytest.mark.release("compiles two loops for 20 s; crosscheck/test_hinge_references.py has both engines")
def test_a_thrown_rotor_stays_within_its_range_on_both_engines():
    """Without end stops the run ends at the end of the range."""
    on = FREE | {"plant.end_stops.on": True, "plant.viscous_Nm_s": [2e-3, 2e-3, 2e-3]}
    tables = {}
    for engine in ("lagrangian", "mujoco"):
        with Session(scenarios.load("tilt", on | {"plant.engine": engine})) as session:
            table = session.advance(3000)
        assert str(session.status) == "running"
        assert np.all(np.abs(table["q_rad"][:, :2]) < np.radians(80))
        assert np.any(table["end_stop_Nm"][:, :2])
        tables[engine] = table["q_rad"]
    # Both are of fourth order; contacts amplify differences of 1e-13 by the mass ratio, 30, a bounce.
    np.testing.assert_allclose(tables["mujoco"], tables["lagrangian"], rtol=0, atol=1e-6)


def test_without_stops_the_run_ends_at_the_end_of_the_range():
    with Session(scenarios.load("tilt", FREE)) as session:
        table = session.advance(3000)
    assert str(session.status) == "left_workspace"
    assert "end_stop_Nm" not in [signal.name for signal in table.signals]


def test_stops_that_are_not_touched_leave_the_motion(actuator):
    start, rates, torque = np.array([0.1, 0.0, -0.2]), np.array([0.4, -0.3, 0.5]), np.zeros((600, 3))
    rotor, stops = ideal_rotor(actuator, STEP_s), stopped(actuator)
    resistance = friction(NONE, NONE, 0.01, STEP_s)
    free, with_stops = (steps(rotor, of, resistance, torque, start, rates) for of in (None, stops))
    # The correction of a step adds and subtracts the pose: one rounding of the angle a step.
    np.testing.assert_allclose(with_stops, free, rtol=0, atol=1e-12)


def test_there_are_no_stops_unless_they_are_on(actuator):
    for section in (EndStopsSection(), EndStopsSection(on=False)):
        assert not EndStops.filled(fill_end_stops, section, RANGE_rad, actuator.inertia, STEP_s)["on"]
    with pytest.raises(InputError, match="expected a travel_rad below half of each hinge's range"):
        stopped(actuator, ON.model_copy(update={"travel_rad": 0.6}))
    rows = Columns([EndStopsSection(on=on, travel_rad=travel) for on, travel in ((False, 0.6), (True, 0.7))])
    with pytest.raises(InputError, match=r"received 0\.7"):
        fill_end_stops(EndStops.zeros(2), rows, RANGE_rad, actuator.inertia, STEP_s)
