"""The linear model against differences of the equations of motion that both engines step, and identities."""

import numpy as np
import pytest
from scipy.signal import cont2discrete

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.linear import linearisation_data, linearise
from spheretwin.loop import assembly
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.lagrangian import acceleration, loaded_inertia
from spheretwin.models.magnetics import torque_matrix
from spheretwin.plant.friction import slow_down
from spheretwin.plant.plant_tick import ENGINES
from tests.twin.plant.motions import friction, gradient
from tests.twin.plant.test_friction import ideal

LOADED = {"plant.modelling_error": 0.2, "plant.payload_kg": 0.05}
TILTED = np.array([0.3, -0.2, 0.4])
POSES = [np.zeros(3), TILTED, np.array([-0.7, 0.9, 2.0])]
UNEVEN = [1 + 0.2 * np.sin(3 * j) for j in range(18)]


def scenario(changes=None):
    return scenarios.load("hold", LOADED | (changes or {}))


@pytest.mark.parametrize("engine", ["mujoco", "lagrangian"])
@pytest.mark.parametrize("pose", POSES, ids=str)
def test_one_physics_step_of_either_engine_has_the_model_s_derivatives(engine, pose):
    """Over a step h a torque is held: x' = exp(A h) x + (∫exp(A s) ds B) u."""
    model = linearise(scenario({"plant.engine": engine}), pose)
    config = initial_config(scenario({"plant.engine": engine}), None, None)
    rotor, h = assembly.rotor_of(config.scenario, config.files), config.scenario.plant.step_s

    def after(at):
        stepped = rotor.start(pose + at[:3], at[3:6])
        stepped.torque_q[:] = model.input_at_rest + at[6:]
        ENGINES[engine].step(stepped)
        return np.concatenate([stepped.q - pose, stepped.qdot])

    np.testing.assert_allclose(after(np.zeros(9)), 0, rtol=0, atol=1e-15)  # it rests: rounding alone
    A, B = cont2discrete((model.system.A, model.system.B, model.system.C, model.system.D), h)[:2]
    # What a step changes, over its length, is A and B to first order: 1e-6 of their largest entries. The
    # engine's own steps are off by (18 1/s² h²)^2, 2e-11; differences of 1e-3 by 1e-16 / 1e-3 / h, 2e-10.
    result = gradient(after, np.zeros(9))
    assert np.abs(model.system.A).max() > 10
    for part, exact, continuous in ((result[:, :6], A, model.system.A), (result[:, 6:], B, model.system.B)):
        np.testing.assert_allclose(part / h, exact / h, rtol=0, atol=1e-6 * np.abs(continuous).max())


@pytest.mark.parametrize("pose", POSES, ids=str)
def test_viscous_friction_damps_as_the_plant_s_does(actuator, pose):
    viscous = np.array([1e-3, 2e-3, 5e-4])
    model = linearise(scenario({"plant.viscous_Nm_s": viscous.tolist()}), pose)
    height = actuator.payload_mount_m[2]
    inertia = loaded_inertia(1.2 * actuator.inertia, 0.05, height)
    # Over a step this short friction is that at the rates before it, to 1e-6.
    acting = friction(np.zeros(3), viscous, 0.01, 1e-6)

    def accelerated(qdot):
        torque = np.zeros(3)
        slow_down(acting, ideal(inertia), pose, qdot.copy(), torque)
        return acceleration(pose, qdot, 2 * torque, inertia, 0.0)  # half a step's share of the mean

    expected = gradient(accelerated, np.zeros(3))
    np.testing.assert_allclose(model.system.A[3:, 3:], expected, rtol=1e-6, atol=1e-9)


def test_a_name_with_changes_is_that_scenario():
    named, loaded = linearise("hold", TILTED, LOADED), linearise(scenario(), TILTED)
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(named.system, name), getattr(loaded.system, name))


def test_coulomb_friction_has_no_linear_part():
    smooth, rough = (linearise(scenario({"plant.coulomb_Nm": [each] * 3}), TILTED) for each in (0.0, 5e-3))
    np.testing.assert_array_equal(rough.system.A, smooth.system.A)


@pytest.mark.parametrize("pose", POSES, ids=str)
def test_currents_pull_as_the_compiled_torque_matrix_says(actuator, pose):
    model = linearise(scenario({"plant.group_gain": UNEVEN}), pose, inputs="currents")
    per_torque = linearise(scenario(), pose).system.B[3:]

    def torque(q):
        return rate_jacobian(q).T @ torque_matrix(q, actuator) @ (UNEVEN * model.input_at_rest)

    # The table meets the curve within 2e-7 of its peak.
    matrix = rate_jacobian(pose).T @ torque_matrix(pose, actuator) * UNEVEN
    assert np.abs(model.system.B[3:] - per_torque @ matrix).max() < 1e-6 * np.abs(model.system.B).max()
    # So its differences over 1e-3 rad are good to some 1e-4.
    pulled = model.system.A[3:, :3] - linearise(scenario(), pose).system.A[3:, :3]
    expected = per_torque @ gradient(torque, pose)
    assert np.abs(pulled - expected).max() <= 1e-3 * np.abs(expected).max()


def test_a_mistaken_controller_is_part_of_the_true_model(actuator):
    """The torque of a command: through the nominal matrix to currents, through the true one back."""
    fields = {"plant.group_gain": UNEVEN, "nominal.torque_scale": 1.25}
    model, plain = linearise(scenario(fields), TILTED), linearise(scenario(), TILTED)
    command = model.input_at_rest

    def given(q):
        matrix = rate_jacobian(q).T @ torque_matrix(q, actuator)
        return (matrix * UNEVEN) @ np.linalg.pinv(1.25 * matrix)

    np.testing.assert_allclose(given(TILTED) @ command, plain.input_at_rest, rtol=1e-6, atol=1e-9)
    expected = plain.system.B[3:] @ given(TILTED)
    np.testing.assert_allclose(model.system.B[3:], expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    turning = plain.system.B[3:] @ gradient(lambda q: given(q) @ command, TILTED)
    change = model.system.A[3:, :3] - plain.system.A[3:, :3]
    assert np.abs(turning).max() > 0.1
    # Differences of the table, as above.
    assert np.abs(change - turning).max() < 1e-3 * np.abs(turning).max()


RATES_rad_s = np.array([1.0, 30.0, 300.0])


def responses(A, B, C):
    return np.array([C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) for w in RATES_rad_s])


LAGS_s = np.linspace(2e-3, 6e-3, 18)


@pytest.mark.parametrize(
    ("inputs", "states", "lag_s"), [("torque", 9, 4e-3), ("currents", 24, 4e-3), ("currents", 24, LAGS_s)]
)
def test_a_lag_is_one_more_pole_of_every_response(inputs, states, lag_s):
    """Where no current flows at rest, x' = A x + B i and i' = (u - i) / lag: G / (1 + lag s)."""
    lag_s = np.broadcast_to(lag_s, 18)[: states - 6]
    given = lag_s.tolist() if inputs == "currents" else lag_s[0]
    unloaded = {"plant.payload_kg": 0.0, "drive.time_constant_s": given, "plant.viscous_Nm_s": [1e-3] * 3}
    plain, late = (linearise(scenario(unloaded), TILTED, inputs=inputs, lag=lag) for lag in (False, True))
    assert late.system.A.shape == (states, states)
    poles = 1 + 1j * lag_s * RATES_rad_s[:, None, None]
    behind, expected = (responses(each.system.A, each.system.B, each.system.C) for each in (late, plain))
    np.testing.assert_allclose(behind * poles, expected, rtol=1e-9, atol=1e-12)


def test_a_lag_under_load_is_the_same_for_torques_and_for_the_currents_that_answer_them(actuator):
    """Currents commanded as the allocation does, also as it follows the pose, are a torque commanded."""
    lagging = scenario({"drive.time_constant_s": 4e-3})
    by_torque, model = (linearise(lagging, TILTED, inputs=each, lag=True) for each in ("torque", "currents"))
    given, system = by_torque.system, model.system

    def allocation(q):
        return np.linalg.pinv(rate_jacobian(q).T @ torque_matrix(q, actuator))

    currents = allocation(TILTED) @ by_torque.input_at_rest
    np.testing.assert_allclose(currents, model.input_at_rest, rtol=0, atol=1e-6 * 0.1)
    slope = gradient(lambda q: allocation(q) @ by_torque.input_at_rest, TILTED)
    closed = system.A + system.B @ np.hstack([slope, np.zeros((18, 21))])
    expected = responses(given.A, given.B, given.C)
    apart = np.abs(responses(closed, system.B @ allocation(TILTED), system.C) - expected)
    # Differences of the table, as above.
    assert np.all(apart.max(axis=(1, 2)) < 1e-3 * np.abs(expected).max(axis=(1, 2)))


def test_the_lag_is_that_of_the_drive():
    assert linearise(scenario({"drive.time_constant_s": 0.0}), lag=True).system.A.shape == (6, 6)
    electronics = scenarios.load("tilt", {"hardware": "electronics"})
    of_amplifiers = linearise(electronics, lag=True).system.A[6:, 6:]
    np.testing.assert_array_equal(of_amplifiers, -electronics.drive.bandwidth_rad_s * np.eye(3))


def test_the_nominal_model_is_what_the_controller_knows():
    fields = {
        "nominal.inertia_kg_m2": [2e-3, 3e-3, 4e-3], "nominal.time_constant_s": 3e-3,
        "nominal.torque_scale": 1.3, "nominal.viscous_Nm_s": [1e-3, 2e-3, 3e-3],
        "plant.viscous_Nm_s": [0.1] * 3, "plant.modelling_torque_Nm": [0.01] * 3,
        "drive.current_limit_A": 1e-3, "nominal.current_limit_A": 5.0,
    }  # fmt: skip
    model = linearise(scenario(fields), np.zeros(3), nominal=True, lag=True)
    A, B = model.system.A, model.system.B
    # Products and quotients round.
    np.testing.assert_allclose(np.linalg.inv(A[3:6, 6:]), np.diag([2e-3, 3e-3, 4e-3]), rtol=1e-12)
    np.testing.assert_allclose(A[3:6, 3:6], -np.diag([0.5, 2 / 3, 0.75]), rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(A[3:6, :3], 0)
    np.testing.assert_array_equal(B[6:], np.eye(3) / 3e-3)
    np.testing.assert_array_equal(model.input_at_rest, 0)
    resting = initial_config(scenario(fields), None, None)
    for nominal, limit_A in ((True, 5.0), (False, 1e-3)):
        data = linearisation_data(resting.scenario, resting.files, nominal=nominal)
        assert data.current_limit_A == limit_A


def test_a_constant_torque_is_held_beside_gravity():
    pull = [0.01, -0.02, 0.03]
    torques = ({"plant.modelling_torque_Nm": each} for each in ([0.0] * 3, pull))
    plain, pulled = (linearise(scenario(changes), TILTED).input_at_rest for changes in torques)
    np.testing.assert_allclose(pulled - plain, pull, rtol=1e-12)


def test_states_inputs_and_outputs_are_named_and_the_first_pose_is_where_it_rests():
    model = linearise(scenario({"plant.initial_rad": [0.1, 0.2, 0.3]}), inputs="currents", lag=True)
    np.testing.assert_array_equal(model.pose_rad, [0.1, 0.2, 0.3])
    assert model.states[:7] == (
        "alpha_rad", "beta_rad", "gamma_rad", "alpha_rad_s", "beta_rad_s", "gamma_rad_s", "current_00_A",
    )  # fmt: skip
    assert len(model.states) == len(model.system.A) == 24
    assert len(model.inputs) == model.system.B.shape[1] == len(model.input_at_rest) == 18
    assert model.outputs == ("alpha_rad", "beta_rad", "gamma_rad")
