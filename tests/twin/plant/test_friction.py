"""Friction of the hinges: exact motions, contraction at any step, and MuJoCo's own damping."""

from copy import copy

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.base.compiled import compiled
from spheretwin.models.joint_chain import JointChain, fill_ideal
from spheretwin.models.lagrangian import inertia_matrix, loaded_inertia
from spheretwin.plant.friction import Friction, fill_friction, slow_down
from tests.twin.plant.allocations import allocates_nothing
from tests.twin.plant.motions import NONE, STEP_s, friction, ideal_rotor, on_gamma, order, steps

COULOMB_Nm, SMOOTHING_rad_s = 5e-3, 1e-3
START = np.array([0.2, -0.3, 0.5, 3.0, -2.0, 20.0])


def motion(actuator, resistance, duration, start=START, torque=NONE):
    """Pose and rates at the start of every step of the Lagrangian plant, and at the end of the last."""
    rotor = ideal_rotor(actuator, resistance.step_s)
    torques = np.tile(torque, (round(duration / resistance.step_s) + 1, 1))
    return steps(rotor, None, resistance, torques, start[:3], start[3:])[:2]


def test_viscous_friction_is_an_exponential_decay(actuator):
    viscous, rate, duration = 1e-2, 10.0, 0.8
    decay = viscous / actuator.inertia[2]
    step_sizes, errors = np.array([4e-3, 2e-3, 1e-3, STEP_s]), []
    for h in step_sizes:
        resistance = friction(NONE, on_gamma(viscous), SMOOTHING_rad_s, h)
        q, qdot = motion(actuator, resistance, duration, np.array([0, 0, 0, 0, 0, rate]))
        np.testing.assert_array_equal(q[:, :2], 0)  # upright, the third hinge alone, with the inertia J3
        rates = qdot[:, 2]
        errors.append(np.abs(rates - rate * np.exp(-decay * h * np.arange(len(rates)))).max())
    # Half a step is off by x³/6 of the rate, x = decay h/2; summed up, by (decay h)²/24e at 1/decay.
    np.testing.assert_array_less(errors, (decay * step_sizes) ** 2 * rate / (24 * np.e))
    assert errors[-1] < 8e-7  # rad/s, at 0.5 ms
    # The next power of the step adds a share of decay h.
    assert 1.98 < order(step_sizes, errors) < 2.02, errors


@pytest.mark.parametrize("direction", [1, -1])
def test_coulomb_friction_has_a_level_for_each_direction(actuator, direction):
    asymmetry, duration = 0.4, 0.5
    resistance = friction(on_gamma(COULOMB_Nm), NONE, SMOOTHING_rad_s, STEP_s, on_gamma(asymmetry))
    _, qdot = motion(actuator, resistance, duration, np.array([0, 0, 0, 0, 0, 5.0 * direction]))
    # Far above the smoothing rate the hinge loses the level times the time; the root is 1 within 1e-7.
    lost = COULOMB_Nm * (1 + direction * asymmetry) * duration / actuator.inertia[2]
    assert abs(qdot[-1, 2]) == pytest.approx(5.0 - lost, rel=1e-6)


def decades(lowest, highest):
    return st.floats(lowest, highest).map(lambda exponent: 10.0**exponent)


def triples(entry):
    return st.tuples(entry, entry, entry).map(np.array)


COEFFICIENTS = triples(st.one_of(st.just(0.0), decades(-9, 3)))
TILT = st.floats(-np.radians(80), np.radians(80))
POSES = st.tuples(TILT, TILT, st.floats(-10, 10)).map(np.array)
RATES = triples(st.one_of(st.just(0.0), st.floats(-300, 300), decades(-9, 2)))


@given(POSES, RATES, COEFFICIENTS, COEFFICIENTS, decades(-9, 1), decades(-7, 0), st.sampled_from([0.0, 0.05]))
def test_no_step_gains_energy_or_turns_back(
    actuator, q, qdot, coulomb, viscous, smoothing, step_s, payload_kg
):
    inertia = loaded_inertia(actuator.inertia, payload_kg, 0.1)
    torque, after = np.zeros(3), qdot.copy()
    slow_down(friction(coulomb, viscous, smoothing, step_s), ideal(inertia), q, after, torque)
    M = inertia_matrix(q, inertia)
    energy = 0.5 * qdot @ M @ qdot
    # Rounding, 1e-16, in matrices whose condition is at most 140 once their diagonal is scaled to 1.
    rounding = 1e-12 * energy
    assert 0.5 * after @ M @ after <= energy + rounding
    assert after @ M @ qdot >= -rounding
    # The torque that is reported does the work: M (after - qdot) over a step, with the mean of both rates.
    work = 0.5 * step_s * torque @ (qdot + after)
    assert abs(work - 0.5 * (after @ M @ after - qdot @ M @ qdot)) <= rounding


def ideal(inertia):
    return JointChain.filled(fill_ideal, inertia)[0]


def slowly(q, qdot, resistance, inertia):
    """Rates after half a step, as the equations read, with a library's solutions."""
    M, half = inertia_matrix(q, inertia), 0.5 * resistance.step_s

    def share(rates, time):
        smooth = np.sqrt(rates**2 + resistance.smoothing_rate_rad_s**2)
        return time * np.linalg.solve(M, np.diag(resistance.viscous_Nm_s + resistance.coulomb_Nm / smooth))

    middle = np.linalg.solve(np.eye(3) + share(qdot, 0.5 * half), qdot)
    X = share(middle, half)
    return np.linalg.solve(np.eye(3) + X + 0.5 * X @ X, qdot)


def test_friction_is_what_a_library_solves(actuator):
    generator = np.random.default_rng(0)
    for _ in range(1000):
        q, qdot = generator.uniform(-1.4, 1.4, 3), generator.uniform(-50, 50, 3)
        coulomb, viscous = 10 ** generator.uniform(-5, 0, (2, 3))
        smoothing, step_s = 10 ** generator.uniform([-3, -5], [0, -2])
        resistance = friction(coulomb, viscous, smoothing, step_s)
        rates, torque = qdot.copy(), np.zeros(3)
        slow_down(resistance, ideal(actuator.inertia), q, rates, torque)
        expected = slowly(q, qdot, resistance, actuator.inertia)
        # Rounding of both solutions, with a condition of some hundred at the largest tilt, squared by X².
        np.testing.assert_allclose(rates, expected, rtol=0, atol=1e-10 * np.abs(qdot).max())
        lost = inertia_matrix(q, actuator.inertia) @ (rates - qdot)
        np.testing.assert_allclose(torque, lost / step_s, rtol=0, atol=1e-12 * np.abs(lost).max() / step_s)


def test_without_coefficients_there_is_no_friction(actuator):
    nothing = friction(NONE, NONE, SMOOTHING_rad_s, STEP_s)
    rates, torque = START[3:].copy(), np.zeros(3)
    slow_down(nothing, ideal(actuator.inertia), START[:3], rates, torque)
    np.testing.assert_array_equal(rates, START[3:])
    for coulomb, viscous in ((on_gamma(1e-3), NONE), (NONE, on_gamma(1e-3))):
        slow_down(
            friction(coulomb, viscous, SMOOTHING_rad_s, STEP_s),
            ideal(actuator.inertia),
            START[:3],
            rates,
            torque,
        )
        assert np.all(rates != START[3:])


VISCOUS_Nm_s = np.array([2e-3, 1e-3, 5e-4])
DURATION_s = 0.4


def by_mujoco(step_s, damping, joint=None, resistance=None):
    """State at the end by stock MuJoCo, under its own damping of the hinges or our friction."""
    model = copy(mjcf.read(actuators.MJCF_PATH).bare)
    model.opt.timestep, model.opt.integrator = step_s, mujoco.mjtIntegrator.mjINT_RK4
    model.dof_damping[:] = damping
    data, torque = mujoco.MjData(model), np.zeros(3)
    data.qpos[:], data.qvel[:] = START[:3], START[3:]
    for _ in range(round(DURATION_s / step_s)):
        if resistance is not None:
            slow_down(resistance, joint, data.qpos, data.qvel, torque)
        mujoco.mj_step(model, data)
        if resistance is not None:
            slow_down(resistance, joint, data.qpos, data.qvel, torque)
    return np.concatenate([data.qpos, data.qvel])


def viscous_friction(step_s):
    return friction(NONE, VISCOUS_Nm_s, SMOOTHING_rad_s, step_s)


STEPS_s = np.array([1.6e-3, 8e-4, 4e-4, 2e-4])


@pytest.mark.parametrize("engine", ["mujoco", "lagrangian"])
def test_a_free_motion_is_that_under_mujoco_s_own_damping(actuator, engine):
    expected = by_mujoco(1e-4, VISCOUS_Nm_s)
    errors = []
    for step_s in STEPS_s:
        resistance = viscous_friction(step_s)
        if engine == "mujoco":
            result = by_mujoco(step_s, 0.0, ideal(actuator.inertia), resistance)
        else:
            q, qdot = motion(actuator, resistance, DURATION_s)
            result = np.concatenate([q[-1], qdot[-1]])
        errors.append(np.abs(result - expected).max())
    # Split symmetrically around the rotor's step: second order.
    assert errors[-1] < 1e-6, errors
    assert 1.95 < order(STEPS_s, errors) < 2.05, errors


@compiled
def slow_first(frictions, joints, q, qdot, torque):
    slow_down(frictions[0], joints[0], q, qdot, torque)


def test_friction_allocates_nothing(actuator):
    frictions = Friction.filled(fill_friction, NONE, VISCOUS_Nm_s, SMOOTHING_rad_s, STEP_s)
    joints = JointChain.filled(fill_ideal, actuator.inertia)
    assert allocates_nothing(slow_first, frictions, joints, *np.zeros((3, 3)))
