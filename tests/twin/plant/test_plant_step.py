"""Public step of the plant against the loop, the linear model and the torque matrix."""

import numba
import numpy as np
import pytest

import spheretwin as st
from spheretwin import plant
from spheretwin.models import actuator as actuators
from spheretwin.models import magnetics
from spheretwin.models.base.errors import InputError
from spheretwin.plant.plant_step import step

FRICTION = {"plant.coulomb_Nm": [2e-3] * 3, "plant.viscous_Nm_s": [1e-4] * 3}
LOOP = {"controller.law": "pd", "plant.engine": "lagrangian", "plant.step_s": 1e-3, "duration": 0.05}
"""One physics step a control period, so that telemetry has the mean current of each."""
LOADED = {
    "plant.payload_kg": 0.05,
    "plant.modelling_error": 0.3,
    "plant.modelling_torque_Nm": [1e-3, 0.0, -2e-3],
    "plant.cable.stiffness_Nm_rad": [0.02, 0.03, 0.01],
    "plant.cable.neutral_rad": [0.2, 0.0, 0.1],
    "plant.group_gain": np.linspace(0.97, 1.03, 18).tolist(),
}
EVERYTHING = LOADED | {
    "hardware": "prototype",
    "plant.stiction.on": False,
    "plant.cable.hysteresis_Nm": [0.0] * 3,
    "plant.thermal.rotor_degC": 60.0,
    "plant.thermal.rotor_heat_capacity_J_K": 1e6,  # so that it stays at 60 degrees
    "disturbance.load": 1.0,
}


def largest_difference(changes):
    """Largest difference between angles of a run and of single steps under its currents, rad."""
    run = st.simulate("nutation", LOOP | changes).telemetry
    parameters = plant.parameters("nutation", LOOP | changes)
    state = plant.State(run["q_rad"][0].copy(), run["qdot_rad_s"][0].copy())
    angles = [state.q_rad]
    for currents, disturbance in zip(run["current_A"], run["disturbance_Nm"], strict=True):
        state = step(state, currents, disturbance, parameters, 1e-3)
        angles.append(state.q_rad)
    assert np.abs(run["q_rad"] - run["q_rad"][0]).max() > 1e-3
    return np.abs(np.array(angles[:-1]) - run["q_rad"]).max()


@pytest.mark.parametrize("changes", [{}, FRICTION], ids=["no friction", "friction"])
def test_steps_are_those_of_the_loop(changes):
    # The same operations; compiled in another place, a product and a sum may be fused or not.
    assert largest_difference(changes) < 1e-13


@pytest.mark.uncompiled
def test_every_parameter_acts_as_in_the_loop():
    # The loop's rotor cools by 1 µK: 1e-9 of a torque that turns it by some 0.1 rad.
    assert largest_difference(EVERYTHING) < 1e-10


def state_of(seed=0):
    generator = np.random.default_rng(seed)
    return plant.State(generator.uniform(-0.5, 0.5, 3), generator.uniform(-5, 5, 3))


def test_a_step_changes_nothing_in_place_and_depends_on_its_arguments_alone():
    parameters, state = plant.parameters("tilt", FRICTION), state_of()
    currents, disturbance = np.linspace(-1, 1, 18), np.array([0.01, -0.02, 0.03])
    arguments = (*state, currents, disturbance, parameters.inertia_kg_m2)
    given = [array.copy() for array in arguments]
    first = step(state, currents, disturbance, parameters, 5e-4)
    step(state_of(1), -currents, disturbance, parameters, 5e-4)
    again = step(state, currents, disturbance, parameters, 5e-4)
    np.testing.assert_array_equal(first, again)
    for before, array in zip(given, arguments, strict=True):
        np.testing.assert_array_equal(before, array)
    assert not np.array_equal(first.q_rad, state.q_rad)


def test_the_torque_matrix_has_the_gain_of_each_group():
    gains = np.linspace(0.9, 1.1, 18)
    parameters = plant.parameters("tilt", {"plant.group_gain": gains.tolist()})
    for seed in range(5):
        q = state_of(seed).q_rad
        expected = magnetics.torque_matrix(q, actuators.load()) * gains
        np.testing.assert_allclose(plant.torque_matrix(q, parameters), expected, rtol=1e-13, atol=1e-15)


def test_a_general_joint_turns_the_torque_matrix():
    tilted = {"plant.mass.axis_tilt_rad": [[0.02, 0.0], [0.0, 0.01], [0.0, 0.0]]}
    ideal, real = (plant.parameters("tilt", changes) for changes in ({}, tilted))
    q = np.zeros(3)  # the axes are tilted, the rotor is not turned
    np.testing.assert_allclose(plant.torque_matrix(q, ideal), plant.torque_matrix(q, real), atol=1e-15)
    q = np.array([0.5, 0.3, 0.2])
    apart = np.abs(plant.torque_matrix(q, ideal) - plant.torque_matrix(q, real)).max()
    assert 1e-4 < apart / np.abs(plant.torque_matrix(q, ideal)).max() < 0.2


def test_a_general_joint_of_other_numbers_is_refused():
    tilted = {"plant.mass.axis_tilt_rad": [[0.02, 0.0], [0.0, 0.01], [0.0, 0.0]]}
    parameters = plant.parameters("tilt", tilted)
    for name in ("axes", "points", "masses", "gravity"):
        joint = parameters.joint.copy()
        joint[name].flat[-1] = np.nan
        for wrong in (joint, np.repeat(parameters.joint, 2)):
            with pytest.raises(InputError, match="plant: expected joint as an array of one joint of finite"):
                step(state_of(), np.zeros(18), np.zeros(3), parameters._replace(joint=wrong), 1e-3)


@numba.njit
def coast(state, parameters, dt, steps):
    for _ in range(steps):
        state = step(state, np.zeros(18), np.zeros(3), parameters, dt)
    return state


def test_a_user_s_compiled_code_calls_it():
    parameters, state, expected = plant.parameters("tilt", FRICTION), state_of(), state_of()
    for _ in range(20):
        expected = step(expected, np.zeros(18), np.zeros(3), parameters, 1e-3)
    reached = coast(state, parameters, 1e-3, 20)
    np.testing.assert_allclose(reached.q_rad, expected.q_rad, rtol=1e-13)
    np.testing.assert_allclose(reached.qdot_rad_s, expected.qdot_rad_s, rtol=1e-13)


def test_names_that_the_package_has_not_are_refused():
    with pytest.raises(AttributeError, match="it has Parameters, Plants, State"):
        _ = plant.stepp
