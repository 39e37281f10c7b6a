"""Systems of python-control: their responses are those of the simulator, to the last bit."""

import numpy as np
import pytest

import control
from spheretwin import plant
from spheretwin import scenario as scenarios
from spheretwin.io_systems import LoopSystem, loop_system, plant_system, reference_inputs
from spheretwin.simulation import simulate


def test_the_response_of_the_loop_is_the_run():
    scenario = scenarios.load("sinusoid", {"duration": 0.05, "plant.engine": "lagrangian"})
    table = simulate(scenario).telemetry
    system, start = loop_system(scenario)
    inputs = reference_inputs(scenario.trajectory.sample(table["t_s"]), table["disturbance_Nm"])
    response = control.input_output_response(system, table["t_s"], inputs, start)
    np.testing.assert_array_equal(response.outputs[:3].T, table["q_rad"])
    np.testing.assert_array_equal(response.outputs[3:].T, table["qdot_rad_s"])


@pytest.mark.release("1.1 s; changes with python-control")
@pytest.mark.uncompiled
@pytest.mark.parametrize("name", ["sinusoid", "tilt"])
def test_the_loop_as_a_function_of_its_state_is_the_run(name):
    """Also of MuJoCo, and with the noise of sensors; without python-control."""
    electronics = {"hardware": "electronics", "controller.law": "pid"} if name == "tilt" else {}
    scenario = scenarios.load(name, {"duration": 0.02, **electronics})
    table, loop = simulate(scenario).telemetry, LoopSystem(scenario)
    inputs = reference_inputs(scenario.trajectory.sample(table["t_s"]), table["disturbance_Nm"])
    x, angles = loop.start, []
    for t, u in zip(table["t_s"], inputs.T, strict=True):
        angles.append(loop.output(x)[:3])
        x = loop.update(t, x, u)
    np.testing.assert_array_equal(angles, table["q_rad"])


def test_the_response_of_the_plant_is_that_of_its_step():
    scenario = scenarios.load("nutation", {"plant.payload_kg": 0.1})
    system, parameters = plant_system(scenario), plant.parameters(scenario)
    times = 1e-3 * np.arange(30)
    inputs = np.vstack([np.sin(np.outer(np.arange(1, 19), 50 * times)), np.full((3, 30), 0.01)])
    response = control.input_output_response(system, times, inputs, np.full(6, 0.1))
    state = plant.State(np.full(3, 0.1), np.full(3, 0.1))
    for given in inputs.T[:-1]:
        for _ in range(2):
            state = plant.step(state, given[:18].copy(), given[18:].copy(), parameters, 5e-4)
    np.testing.assert_array_equal(response.outputs[:, -1], np.concatenate(state))


def test_python_control_linearises_the_plant_as_linearise_does():
    scenario = scenarios.load("hold", {"plant.payload_kg": 0.1})
    sampled = plant_system(scenario).linearize(np.zeros(6), np.zeros(21))
    continuous = plant.linearise(scenario, np.zeros(3), inputs="currents", kind="control").system
    exact = control.sample_system(continuous, 1e-3)
    # Two steps that hold the torque, and forward differences of 1e-6 of python-control.
    np.testing.assert_allclose(sampled.A, exact.A, rtol=0, atol=1e-5)
    np.testing.assert_allclose(sampled.B[:, :18], exact.B, rtol=0, atol=1e-4)
