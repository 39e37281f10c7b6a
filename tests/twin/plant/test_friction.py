"""Friction of the hinges: exact motions, contraction at any step, and MuJoCo's own damping."""

from copy import copy

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba.core.runtime import _nrt_python, rtsys

from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.base.compiled import compiled
from spheretwin.models.base.errors import InputError
from spheretwin.models.lagrangian import inertia_matrix, loaded_inertia
from spheretwin.twin.plant import lagrangian
from spheretwin.twin.plant.friction import friction, friction_torque
from spheretwin.twin.plant.lagrangian import LagrangianRotor

NONE = np.zeros(3)
STEP_S, COULOMB_Nm, SMOOTHING_rad_s = 5e-4, 5e-3, 1e-3
START = np.array([0.2, -0.3, 0.5, 3.0, -2.0, 20.0])


def on_gamma(value):
    return np.array([0.0, 0.0, value])


@compiled
def moving(plant, friction, torque, q, qdot):
    """Step with friction beside a constant torque on the hinges, and keep every state."""
    on_hinges = np.empty(3)
    for row in range(q.shape[0]):
        for i in range(3):
            q[row, i], qdot[row, i] = plant.q[i], plant.qdot[i]
        friction_torque(friction, plant.q, plant.qdot, on_hinges)
        for i in range(3):
            plant.torque_q[i] = torque[i] + on_hinges[i]
        lagrangian.step(plant)


def motion(actuator, resistance, duration, start=START, torque=NONE):
    """Pose and rates at the end of every step of the Lagrangian plant, and at its start."""
    plant = LagrangianRotor(actuator, resistance.step_s).start(start[:3], start[3:])
    q, qdot = np.empty((2, round(duration / resistance.step_s) + 1, 3))
    moving(plant, resistance, torque, q, qdot)
    return q, qdot


def spin(actuator, resistance, duration, rate, torque=0.0):
    """The third hinge alone, upright: a motion in one dimension, with the inertia J3."""
    start = np.array([0, 0, 0, 0, 0, rate])
    q, qdot = motion(actuator, resistance, duration, start, on_gamma(torque))
    np.testing.assert_array_equal(q[:, :2], 0)
    return q[:, 2], qdot[:, 2]


def order(steps, errors):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def test_viscous_friction_is_an_exponential_decay(actuator):
    viscous, rate, duration = 1e-2, 10.0, 0.8
    decay = viscous / actuator.inertia[2]
    steps, errors = np.array([4e-3, 2e-3, 1e-3, STEP_S]), []
    for h in steps:
        resistance = friction(NONE, on_gamma(viscous), SMOOTHING_rad_s, actuator.inertia, h)
        _, rates = spin(actuator, resistance, duration, rate)
        errors.append(np.abs(rates - rate * np.exp(-decay * h * np.arange(len(rates)))).max())
    # An implicit Euler step is off by (decay h)²/2 of the rate; summed up, by decay h / 2e at 1/decay.
    np.testing.assert_array_less(errors, decay * steps * rate / (2 * np.e))
    assert errors[-1] < 4.1e-3  # rad/s, at 0.5 ms
    assert 0.98 < order(steps, errors) < 1.02, errors  # the next power of the step adds decay h / 2


def test_coulomb_friction_is_a_ramp_to_rest(actuator):
    rate, duration = 5.0, 3.3
    slope = COULOMB_Nm / actuator.inertia[2]  # at rest after 2.26 s
    errors = []
    for h in (4 * STEP_S, 2 * STEP_S, STEP_S):
        resistance = friction(on_gamma(COULOMB_Nm), NONE, SMOOTHING_rad_s, actuator.inertia, h)
        angles, rates = spin(actuator, resistance, duration, rate)
        t = h * np.arange(len(rates))
        errors.append(np.abs(rates - np.maximum(rate - slope * t, 0)).max())
        # Each step lags by (slope h)²/rate, whose sum is a logarithm; smoothing lags by its own rate.
        lag = slope * h
        assert errors[-1] < lag * (1 + np.log(rate / lag)) + SMOOTHING_rad_s
        # The last second: at rest, where each step leaves 1 / (1 + h k(0) / J), at most 0.47, of the rate.
        assert np.all(np.diff(rates) <= 0)  # never back
        assert np.all(rates >= 0)
        assert rates[t > 2.4].max() < 1e-12
        assert np.ptp(angles[t > 2.4]) < 1e-12
    assert errors[-1] < 7.5e-3  # rad/s, at 0.5 ms


@pytest.mark.parametrize("h", [5e-4, 5e-5])
def test_below_its_level_coulomb_friction_creeps_as_slowly_as_it_is_smooth(actuator, h):
    smoothing, torque, inertia = 0.05, 0.5 * COULOMB_Nm, actuator.inertia[2]
    resistance = friction(on_gamma(COULOMB_Nm), NONE, smoothing, actuator.inertia, h)
    _, rates = spin(actuator, resistance, 1.0, 0.0, torque)
    steady = rates[-1]
    # 44 time constants J/k(0) from rest: nothing is left of the start but rounding in the last steps.
    factor = COULOMB_Nm / np.hypot(steady, smoothing)
    assert factor * (steady - h * torque / inertia) == pytest.approx(torque, rel=1e-11)
    in_the_limit = smoothing * torque / np.sqrt(COULOMB_Nm**2 - torque**2)
    # To first order in the step, a share of h k(v)/J over 1 - (T/C)², which is 1.155 h k(0)/J.
    share = 1.155 * h * COULOMB_Nm / (smoothing * inertia)
    assert steady / in_the_limit - 1 == pytest.approx(share, rel=0.01)


def test_above_its_level_coulomb_friction_leaves_the_rest_of_the_torque(actuator):
    torque, duration, rate = 2 * COULOMB_Nm, 0.1, 10.0
    resistance = friction(on_gamma(COULOMB_Nm), NONE, SMOOTHING_rad_s, actuator.inertia, STEP_S)
    _, rates = spin(actuator, resistance, duration, rate, torque)
    mean = (rates[-1] - rate) / duration
    # The implicit step takes h C / (J v) off friction, 1.1e-4 of it; smoothing takes 5e-9.
    assert mean == pytest.approx((torque - COULOMB_Nm) / actuator.inertia[2], rel=1.2e-4)


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
    torque = np.empty(3)
    friction_torque(friction(coulomb, viscous, smoothing, inertia, step_s), q, qdot, torque)
    M = inertia_matrix(q, inertia)
    after = qdot + step_s * np.linalg.solve(M, torque)
    energy = 0.5 * qdot @ M @ qdot
    # Rounding, 1e-16, in matrices whose condition is at most 140 once their diagonal is scaled to 1.
    rounding = 1e-12 * energy
    assert 0.5 * after @ M @ after <= energy + rounding
    assert after @ M @ qdot >= -rounding
    assert torque @ after <= rounding / step_s


def slow_torque(q, qdot, resistance):
    """The law as it reads, with a library's solution; and the rates that it is of."""
    smooth = np.sqrt(qdot**2 + resistance.smoothing_rate_rad_s**2)
    K = np.diag(resistance.viscous_Nm_s + resistance.coulomb_Nm / smooth)
    M = inertia_matrix(q, resistance.inertia)
    v = np.linalg.solve(M + resistance.step_s * K, M @ qdot)
    return -K @ v, v


def test_friction_is_what_a_library_solves(actuator):
    generator, torque = np.random.default_rng(0), np.empty(3)
    for _ in range(1000):
        q, qdot = generator.uniform(-1.4, 1.4, 3), generator.uniform(-50, 50, 3)
        coulomb, viscous = 10 ** generator.uniform(-5, 0, (2, 3))
        smoothing, step_s = 10 ** generator.uniform([-3, -5], [0, -2])
        resistance = friction(coulomb, viscous, smoothing, actuator.inertia, step_s)
        friction_torque(resistance, q, qdot, torque)
        expected, v = slow_torque(q, qdot, resistance)
        # Rounding of both solutions, with a condition of some hundred at the largest tilt.
        np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        assert np.all(torque * v <= 0)  # on no hinge is power fed in


def test_without_coefficients_there_is_no_friction(actuator):
    nothing = friction(NONE, NONE, SMOOTHING_rad_s, actuator.inertia, STEP_S)
    torque = np.full(3, np.nan)
    friction_torque(nothing, START[:3], START[3:], torque)
    np.testing.assert_array_equal(torque, 0)
    assert not nothing.acts
    for coulomb, viscous in ((on_gamma(1e-3), NONE), (NONE, on_gamma(1e-3))):
        assert friction(coulomb, viscous, SMOOTHING_rad_s, actuator.inertia, STEP_S).acts


VISCOUS_Nm_s = np.array([2e-3, 1e-3, 5e-4])
DURATION_s = 0.4


def by_mujoco(step_s, integrator, damping, resistance=None, start=START, duration=DURATION_s):
    """State at the end by stock MuJoCo: its own damping of the hinges, or our friction applied to them."""
    model = copy(mjcf.read(actuators.MJCF_PATH).bare)
    model.opt.timestep, model.opt.integrator = step_s, integrator
    model.dof_damping[:] = damping
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start[:3], start[3:]
    for _ in range(round(duration / step_s)):
        if resistance is not None:
            friction_torque(resistance, data.qpos, data.qvel, data.qfrc_applied)
        mujoco.mj_step(model, data)
    return np.concatenate([data.qpos, data.qvel])


def viscous_friction(actuator, step_s):
    return friction(NONE, VISCOUS_Nm_s, SMOOTHING_rad_s, actuator.inertia, step_s)


STEPS_s = np.array([1.6e-3, 8e-4, 4e-4, 2e-4])


def test_a_free_motion_is_that_under_mujoco_s_own_damping(actuator):
    expected = by_mujoco(1e-4, mujoco.mjtIntegrator.mjINT_RK4, VISCOUS_Nm_s)
    errors = []
    for step_s in STEPS_s:
        q, qdot = motion(actuator, viscous_friction(actuator, step_s), DURATION_s)
        errors.append(np.abs(np.concatenate([q[-1], qdot[-1]]) - expected).max())
    # Held over a step instead of following every stage of it: first order, 5.1 rad/s a second of step.
    assert errors[-1] < 1.1e-3
    assert 0.98 < order(STEPS_s, errors) < 1.02, errors


def test_friction_on_mujoco_is_its_own_implicit_damping(actuator):
    implicit, errors = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, []
    steps = STEPS_s / 2
    for step_s in steps:
        ours = by_mujoco(step_s, implicit, 0.0, viscous_friction(actuator, step_s))
        errors.append(np.abs(ours - by_mujoco(step_s, implicit, VISCOUS_Nm_s)).max())
    # MuJoCo damps what the Coriolis torque adds in the same step, we in the next: 9.7 rad/s a second of step.
    assert errors[-1] < 1e-3
    assert 0.98 < order(steps, errors) < 1.04, errors  # the next power of the step adds to its side
    # Without other torques both solve the same equation, whatever the step.
    upright = np.array([0, 0, 0.5, 0, 0, 20.0])
    for step_s in (1e-3, 0.1):
        resistance = viscous_friction(actuator, step_s)
        ours = by_mujoco(step_s, implicit, 0.0, resistance, upright)
        theirs = by_mujoco(step_s, implicit, VISCOUS_Nm_s, None, upright)
        # Rounding, and the gimbal rings: 5e-13 of the inertia.
        np.testing.assert_allclose(ours, theirs, rtol=1e-11)


def test_friction_allocates_nothing(actuator):
    resistance, (q, qdot, torque) = viscous_friction(actuator, STEP_S), np.zeros((3, 3))
    _nrt_python.memsys_enable_stats()

    def allocations(count):
        before = rtsys.get_allocation_stats().alloc
        repeated(count, resistance, q, qdot, torque)
        return rtsys.get_allocation_stats().alloc - before

    # What is left is the wrapping of the arguments, once a call from Python.
    assert allocations(1000) == allocations(1)


@compiled
def repeated(count, friction, q, qdot, torque):
    for _ in range(count):
        friction_torque(friction, q, qdot, torque)


@pytest.mark.parametrize(
    ("coulomb", "viscous", "smoothing", "told"),
    [
        ([0, -1e-3, 0], NONE, 1e-3, r"expected coulomb_Nm of three finite .* received \[0, -0.001, 0\]"),
        (NONE, [0, np.nan, 0], 1e-3, "expected viscous_Nm_s of three finite"),
        (NONE, [1e-3], 1e-3, r"expected viscous_Nm_s .* received \[0.001\]"),
        (NONE, NONE, 0.0, "expected a finite smoothing_rate_rad_s of at least 1e-12, received 0"),
        (NONE, NONE, np.inf, "smoothing_rate_rad_s of at least 1e-12, received inf"),
    ],
)
def test_coefficients_that_are_none_are_refused(actuator, coulomb, viscous, smoothing, told):
    with pytest.raises(InputError, match=told):
        friction(coulomb, viscous, smoothing, actuator.inertia, STEP_S)
