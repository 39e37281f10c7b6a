"""Many plants in lockstep against the step of a single one."""

import numpy as np
import pytest

from spheretwin import plant
from spheretwin.plant.plant_step import step
from tests.twin.plant.test_plant_step import LOADED

FRICTION = {
    "plant.coulomb_Nm": [2e-3, 5e-3, 0.0],
    "plant.coulomb_asymmetry": [0.3, -1.0, 0.5],
    "plant.viscous_Nm_s": [1e-4, 0.0, 2e-4],
}
SCATTER = {"plant.poles.gain_error": 0.05, "plant.coils.angle_error_rad": 5e-3}
TILTED = {"plant.mass.axis_tilt_rad": [[0.02, 0.0], [0.0, 0.01], [0.0, 0.0]]}
KINDS = {"ideal": {}, "friction": FRICTION, "loaded": FRICTION | LOADED, "scatter": LOADED | SCATTER}
dt = 5e-4


def motion(count, seed=0):
    """States, currents and disturbances of some plants."""
    generator = np.random.default_rng(seed)
    q, qdot = generator.uniform(-0.6, 0.6, (count, 3)), generator.uniform(-20, 20, (count, 3))
    return q, qdot, generator.uniform(-2, 2, (count, 18)), generator.uniform(-0.05, 0.05, (count, 3))


def one_by_one(parameters, q, qdot, currents, disturbance, steps):
    """Angles and rates that single steps reach."""
    reached = []
    for number, each in enumerate(parameters):
        state = plant.State(q[number], qdot[number])
        for _ in range(steps):
            state = step(state, currents[number], disturbance[number], each, dt)
        reached.append(state)
    return np.array([state.q_rad for state in reached]), np.array([state.qdot_rad_s for state in reached])


def together(parameters, q, qdot, currents, disturbance, steps):
    """Angles and rates that the same plants reach in lockstep."""
    plants = plant.Plants(parameters)
    plants.set_state(q, qdot)
    plants.step(currents, disturbance, dt, steps)
    return plants.q_rad, plants.qdot_rad_s


def assert_equal(first, second):
    # Sine and cosine differ by some 1e-16; the torque table multiplies that by its slope, some 1e2 1/rad.
    np.testing.assert_allclose(first[0], second[0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(first[1], second[1], rtol=0, atol=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_each_plant_moves_as_alone(kind):
    parameters = [plant.parameters("nutation", KINDS[kind] | {"seed": seed}) for seed in range(19)]
    case = motion(19)
    reached = together(parameters, *case, 20)
    assert np.abs(reached[0] - case[0]).max() > 0.1
    assert_equal(reached, one_by_one(parameters, *case, 20))


def test_torque_curves_of_different_plants_stay_apart():
    shipped = plant.parameters("tilt")
    tables = shipped.magnetics.tables._replace(curve=1.1 * shipped.magnetics.tables.curve)
    stronger = shipped._replace(magnetics=shipped.magnetics._replace(tables=tables))
    parameters = [shipped, stronger, shipped, stronger]
    case = motion(4, seed=2)
    assert_equal(together(parameters, *case, 10), one_by_one(parameters, *case, 10))


def test_torques_on_the_hinges_act_as_disturbances_do():
    parameters = [plant.parameters("tilt", FRICTION | LOADED)] * 2 + [plant.parameters("tilt", TILTED)]
    q, qdot, _, torque_q = motion(3, seed=3)
    plants = plant.Plants(parameters)
    plants.set_state(q, qdot)
    plants.step_torque(torque_q, dt, 20)
    expected = one_by_one(parameters, q, qdot, np.zeros((3, 18)), -torque_q, 20)
    assert_equal((plants.q_rad, plants.qdot_rad_s), expected)


def test_neither_lane_nor_number_of_plants_nor_calls_change_a_bit():
    parameters, (q, qdot, currents, disturbance) = plant.parameters("tilt", FRICTION), motion(40, seed=4)
    every = together([parameters] * 40, q, qdot, currents, disturbance, 6)
    for number in (0, 15, 16, 39):
        alone = plant.Plants(parameters)
        alone.set_state(q[number], qdot[number])
        for _ in range(2):
            alone.step(currents[number], disturbance[number], dt, 3)
        np.testing.assert_array_equal(alone.q_rad[0], every[0][number])
        np.testing.assert_array_equal(alone.qdot_rad_s[0], every[1][number])


def test_a_plant_that_diverges_leaves_the_others_alone():
    parameters, (q, qdot, currents, disturbance) = plant.parameters("tilt", FRICTION), motion(3, seed=5)
    expected = together([parameters] * 3, q, qdot, currents, disturbance, 10)
    qdot[1] = 1e200
    reached = together([parameters] * 3, q, qdot, currents, disturbance, 10)
    assert not np.isfinite(reached[1][1]).all()
    np.testing.assert_array_equal(reached[0][[0, 2]], expected[0][[0, 2]])


def test_parameters_and_states_of_one_plant_are_set_between_steps():
    first, second = plant.parameters("tilt"), plant.parameters("tilt", FRICTION | LOADED | SCATTER)
    q, qdot, currents, disturbance = motion(3, seed=6)
    plants = plant.Plants(first, 3)
    plants.set_state(q, qdot)
    plants.set_parameters(1, second)
    plants.set_state([0.1, 0.2, 0.3], 0.0, 2)
    q[2], qdot[2] = [0.1, 0.2, 0.3], 0.0
    np.testing.assert_array_equal(plants.q_rad, q)
    np.testing.assert_array_equal(plants.qdot_rad_s, qdot)
    plants.step(currents, disturbance, dt, 10)
    expected = one_by_one([first, second, first], q, qdot, currents, disturbance, 10)
    assert_equal((plants.q_rad, plants.qdot_rad_s), expected)
    assert len(plants) == 3
    assert plants.groups == 18


def test_values_of_all_plants_are_given_once():
    parameters, case = plant.parameters("tilt"), motion(1, seed=7)
    plants = plant.Plants(parameters, 18)
    plants.set_state(case[0][0], case[1][0])
    plants.step(case[2][0], case[3][0], dt)
    expected = one_by_one([parameters], *case, 1)
    assert_equal((plants.q_rad, plants.qdot_rad_s), np.repeat(expected, 18, axis=1))
