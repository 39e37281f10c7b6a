"""What faults do to currents, torques and energies: differential equations and identities."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spheretwin import scenario as scenarios
from spheretwin.faults.schedule import FaultSchedule
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.magnetics import torque_matrix
from spheretwin.session import Session

GROUPS, R_OHM, L_H, STEP_S = 18, 1.3, 0.9e-3, 1e-3
COLD = {"drive.resistance_per_K": 0.0, "watchdog.on": False, "plant.engine": "mujoco"}


def prototype(*faults, **changes):
    fields = {"hardware": "electronics", "fault": list(faults), "plant.step_s": STEP_S, "seed": 2}
    return scenarios.load("nutation", {**fields, **COLD, **changes})


def each(mode, kind="coil", **more):
    return [{"target": f"{kind}.{group:02d}", "mode": mode, **more} for group in range(GROUPS)]


def amid(q, qdot, before):
    """Poses and rates in the middle of each period, as the plant predicts; `before` are the rates then."""
    last = np.vstack([before, qdot[:-1]])
    return q + 0.5 * STEP_S * qdot, qdot + 0.5 * (qdot - last)


def emfs(middle_q, middle_qdot, actuator):
    """Back-EMF of a group of full turns, (ticks, n) in V, held over each period."""
    return np.array(
        [
            torque_matrix(q, actuator).T @ rate_jacobian(q) @ qdot
            for q, qdot in zip(middle_q, middle_qdot, strict=True)
        ]
    )


def stepped(scenario, ticks):
    """Rows of a run, one at a time, and the currents (ticks + 1, n), A, between them."""
    with Session(scenario) as session:
        currents, parts = [session._runtime._plant.current.copy()], []
        for _ in range(ticks):
            parts.append(session.advance(1))
            currents.append(session._runtime._plant.current.copy())
        return parts, np.array(currents), session.actuator


def column(parts, name):
    return np.concatenate([part[name] for part in parts])


def test_an_open_coil_has_no_current_and_no_torque():
    with Session(prototype(*each("open", start_s=0.05)[:9])) as session:
        table, actuator = session.advance(150), session.actuator
    currents = table["current_A"]
    assert np.all(np.abs(currents[45:50, :9]).max(axis=0) > 1e-3)
    assert not currents[50:, :9].any()
    assert not table["copper_loss_W"][50:, :9].any()
    assert not table["coil_power_W"][50:, :9].any()
    for tick in (60, 100, 149):
        middle = table["q_rad"][tick] + 0.5 * STEP_S * table["qdot_rad_s"][tick]
        G = torque_matrix(middle, actuator)
        # Sums of eighteen products, rounded in another order.
        np.testing.assert_allclose(
            table["torque_Nm"][tick], G[:, 9:] @ currents[tick, 9:], rtol=0, atol=1e-14
        )


def test_a_shorted_coil_carries_what_its_emf_drives():
    """`L di/dt = -R i - e` with the EMF of the motion that was logged, by an ODE solver."""
    with Session(prototype({"target": "coil.04", "mode": "short", "start_s": 0.3})) as session:
        session.advance(299)
        before = session.advance(1)
        start = session._runtime._plant.current[4]
        table, actuator = session.advance(200), session.actuator
    assert len(before) == 1
    middle = amid(table["q_rad"], table["qdot_rad_s"], before["qdot_rad_s"])
    emf = emfs(*middle, actuator)[:, 4]
    solution = solve_ivp(
        lambda t, i: (-R_OHM * i - emf[min(int(t / STEP_S), 199)]) / L_H,
        (0, 0.2), [start], method="RK45", max_step=STEP_S / 5, rtol=1e-10, atol=1e-12,
        dense_output=True,
    )  # fmt: skip
    within = np.linspace(0, STEP_S, 101)
    means = [np.trapezoid(solution.sol(tick * STEP_S + within)[0], within) / STEP_S for tick in range(200)]
    # The solver steps over the corners of the EMF, the trapezoids are 1e-4 of a decay within the first step.
    np.testing.assert_allclose(table["current_A"][:, 4], means, rtol=0, atol=2e-4 * np.abs(means).max())
    assert np.abs(means[100:]).max() > 0.01


FEWER = np.linspace(0.1, 0.9, GROUPS)
"""Shares of the turns that are left in each coil."""
FEWER_TURNS = [{"target": f"coil.{j:02d}", "mode": "gain", "value": share} for j, share in enumerate(FEWER)]
SPINNING = {"plant.initial_rad_s": [2.0, -1.0, 5.0]}


@pytest.mark.parametrize(
    ("faults", "changes", "shares"),
    [(each("short"), SPINNING, np.ones(GROUPS)), (FEWER_TURNS, {}, FEWER)],
    ids=["shorted", "fewer turns"],
)
def test_power_at_the_coils_is_heat_and_field_and_the_power_of_the_torque(faults, changes, shares):
    """An identity to rounding: turns scale torque and EMF alike; heat of shorted coils is from the motion."""
    parts, currents, actuator = stepped(prototype(*faults, **changes), 200)
    power, copper_W = column(parts, "coil_power_W").sum(axis=1), column(parts, "copper_loss_W").sum(axis=1)
    field = np.sum(0.5 * L_H * np.diff(currents**2, axis=0), axis=1) / STEP_S
    q, qdot = column(parts, "q_rad"), column(parts, "qdot_rad_s")
    middle_q, middle_qdot = amid(q, qdot, qdot[:1])
    rate_S = np.array([rate_jacobian(pose) @ rate for pose, rate in zip(middle_q, middle_qdot, strict=True)])
    moving = np.sum(column(parts, "torque_Nm") * rate_S, axis=1)
    # Sums of eighteen powers, which cancel to some mW: 1e-13 of their size.
    size = np.abs(power).max() + copper_W.max()
    np.testing.assert_allclose(power - copper_W - field, moving, rtol=0, atol=1e-13 * size)
    if not np.any(power):  # no voltage at shorted ends
        assert np.all(moving[5:] < 0)
    assert np.any(power) == (faults is FEWER_TURNS)
    for tick in (50, 150):
        expected = torque_matrix(middle_q[tick], actuator) @ (shares * column(parts, "current_A")[tick])
        np.testing.assert_allclose(column(parts, "torque_Nm")[tick], expected, rtol=0, atol=1e-14)


def test_without_a_supply_all_groups_are_as_good_as_shorted():
    """No voltage at the coils: the currents of shorted ones, but with nothing drawn."""
    times = {"start_s": 0.1}
    silent = {"drive.amplifier_offset_V": 0.0}
    with (
        Session(prototype({"target": "supply", "mode": "dropout", **times}, **silent)) as dark,
        Session(prototype(*each("short", **times), **silent)) as shorted,
    ):
        one, other = dark.advance(200), shorted.advance(200)
    for name in ("current_A", "copper_loss_W", "torque_Nm", "q_rad", "coil_temperature_degC"):
        # One current by way of a limit of 0 V, the other without: the same exponentials, rounded elsewhere.
        np.testing.assert_allclose(one[name], other[name], rtol=0, atol=1e-12 * np.abs(other[name]).max())
    assert not one["supply_power_W"][100:].any()
    # Through a limit of 0 V no work is done at all, to the bit.
    assert not one["coil_power_W"][100:].any()


def test_a_shorted_coil_draws_from_the_supply_what_its_amplifier_drives_past_it():
    steady = {"drive.amplifier_offset_V": 0.0, "drive.dac_bits": 0, "drive.delay_s": 0.0}
    with Session(prototype(*each("short"), **steady)) as session:
        table = session.advance(50)
    expected = 24 * np.abs(np.clip(table["current_command_A"], -8, 8)).sum(axis=1)
    np.testing.assert_allclose(table["supply_power_W"], expected, rtol=1e-13)


def test_several_noises_of_one_source_are_one_of_their_root_sum_of_squares():
    faults = each("noise", "amplifier", value=0.3) + each("noise", "amplifier", value=0.4)
    with Session(prototype(*faults)) as session:
        session.advance(1)
        drive = session._runtime._plant.drive
    np.testing.assert_allclose(drive.stages["amplifier"].line.noise, 0.5, rtol=1e-15)
    assert not drive.stages["dac"].line.noise.any()
    assert len(FaultSchedule(session.scenario.fault, GROUPS, STEP_S, 0)) == 36
