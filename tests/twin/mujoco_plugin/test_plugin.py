"""Plugin in MuJoCo's own programs: its torque, agreement with our engines, many simulations at once."""

import copy
import gc
import runpy
import sys

import mujoco
import numpy as np
import pytest
from mujoco import batch, rollout, viewer

from spheretwin import mujoco_plugin, plant
from spheretwin.models import kinematics, magnetics
from spheretwin.mujoco_plugin import registration
from spheretwin.simulation import simulate
from tests.requirements import needs_compiled_functions

pytestmark = needs_compiled_functions

TICKS, SIMULATIONS = 40, 6


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_path(str(mujoco_plugin.EXAMPLE))


def test_torque_and_sensors_are_those_of_the_torque_matrix(model, actuator):
    random, data = np.random.default_rng(1), mujoco.MjData(model)
    for _ in range(100):
        data.qpos[:], data.qvel[:] = random.uniform(-1.3, 1.3, 3), random.normal(size=3)
        data.ctrl[:] = current = random.uniform(-8, 8, 18)
        mujoco.mj_forward(model, data)
        G, E = magnetics.torque_matrix(data.qpos, actuator), kinematics.rate_jacobian(data.qpos)
        # Sums of 18 products of at most 0.16 N·m in another order.
        np.testing.assert_allclose(data.qfrc_actuator, E.T @ G @ current, rtol=0, atol=2e-15)
        np.testing.assert_allclose(data.sensor("coil_torque").data, G @ current, rtol=0, atol=2e-15)
        np.testing.assert_allclose(data.sensor("coil_emf").data, G.T @ E @ data.qvel, rtol=0, atol=2e-15)
        np.testing.assert_array_equal(data.sensor("coil_current").data, current)


@pytest.fixture(scope="module")
def recorded():
    """Run on MuJoCo with currents that follow at once, and without torque of others."""
    zero = (
        "plant.modelling_error",
        "disturbance.load",
        "disturbance.random_bound_Nm",
        "drive.time_constant_s",
    )
    changes = {"duration": 0.2, "plant.modelling_torque_Nm": [0.0, 0.0, 0.0], **dict.fromkeys(zero, 0.0)}
    return simulate("sinusoid", changes)


def replayed(model, table, step_s):
    """Angles at the end under the currents of a run, each held over a tick of 1 ms."""
    model.opt.timestep = step_s
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = table["q_rad"][0], table["qdot_rad_s"][0]
    for current in table["current_A"][:-1]:
        data.ctrl[:] = current
        mujoco.mj_step(model, data, nstep=round(1e-3 / step_s))
    return data.qpos.copy()


def test_replayed_currents_turn_the_rotor_as_in_simulate(model, recorded):
    table = recorded.telemetry
    difference = np.abs(replayed(model, table, 5e-4) - table["q_rad"][-1]).max()
    # Our step holds the torque of its middle, the engine's RK4 has that of each stage: 5e-7 rad in 0.3 s.
    assert difference < 1e-6


def test_the_difference_from_the_plant_step_is_of_second_order(model, recorded):
    table, parameters = recorded.telemetry, plant.parameters(recorded.scenario)

    def difference(step_s):
        state = plant.State(table["q_rad"][0].copy(), table["qdot_rad_s"][0].copy())
        for current in table["current_A"][:-1]:
            for _ in range(round(1e-3 / step_s)):
                state = plant.step(state, current, np.zeros(3), parameters, step_s)
        return np.abs(replayed(model, table, step_s) - state.q_rad).max()

    # Halving a step of second order divides its error by 4, up to terms of higher order.
    assert difference(1e-3) / difference(5e-4) == pytest.approx(4, rel=0.02)


def trajectory(model, q, currents):
    data, rows = mujoco.MjData(model), []
    data.qpos[:] = q
    for current in currents:
        data.ctrl[:] = current
        mujoco.mj_step(model, data)
        rows.append(np.concatenate([data.qpos, data.qvel, data.sensordata]))
    return rows


@pytest.fixture(scope="module")
def simulations(model):
    """Poses, currents and rows (angles, rates, sensors) of simulations, each in data of its own."""
    random = np.random.default_rng(0)
    q = random.uniform(-0.5, 0.5, (SIMULATIONS, 3))
    currents = random.uniform(-2, 2, (SIMULATIONS, TICKS, 18))
    return q, currents, np.array([trajectory(model, *one) for one in zip(q, currents, strict=True)])


def test_rollout_on_two_threads_gives_the_same_bits(model, simulations):
    q, currents, expected = simulations
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    states = np.zeros((SIMULATIONS, mujoco.mj_stateSize(model, kind)))
    states[:, 1:4] = q  # after the time
    threads = [mujoco.MjData(model) for _ in range(2)]
    reached, sensors = rollout.rollout(model, threads, states, currents)
    np.testing.assert_array_equal(reached[:, :, 1:7], expected[:, :, :6])
    np.testing.assert_array_equal(sensors, expected[:, :, 6:])


@pytest.mark.parametrize("persistent", [False, True])
def test_a_batch_on_two_threads_gives_the_same_bits(model, simulations, persistent):
    q, currents, expected = simulations
    many = batch.Batch(model, SIMULATIONS, 2, persistent=persistent)
    views = [many.bind(field) for field in ("qpos", "qvel", "sensordata")]
    views[0][:] = q
    for tick in range(TICKS):
        many.bind("ctrl")[:] = currents[:, tick]
        many.step()
        np.testing.assert_array_equal(np.concatenate(views, axis=1), expected[:, tick])


def test_copied_data_goes_on_alone(model, simulations):
    _, currents, _ = simulations
    first = mujoco.MjData(model)
    first.ctrl[:] = currents[0, 0]
    mujoco.mj_step(model, first, nstep=5)
    second = copy.copy(first)
    for data in (first, second):
        mujoco.mj_step(model, data, nstep=5)
    np.testing.assert_array_equal(first.qpos, second.qpos)


@pytest.mark.release("0.8 s; changes with MuJoCo")
def test_memory_of_deleted_data_is_released(model):
    mujoco.MjData(model)
    gc.collect()
    newest = mujoco.MjData(model)  # releases the memory of the one before
    before = len(registration._CONTEXTS)
    many = [mujoco.MjData(model) for _ in range(5)]
    assert len(registration._CONTEXTS) == before + 5
    del many
    gc.collect()
    mujoco.MjData(model)
    assert len(registration._CONTEXTS) == before + 1
    assert newest.qpos.shape == (3,)


@pytest.mark.parametrize(("arguments", "code", "lines"), [([], 0, 0), (["none.xml"], 2, 1)])
def test_the_launcher_opens_the_example_or_reports_an_invalid_model_in_one_line(
    monkeypatch, capsys, arguments, code, lines
):
    opened = []
    monkeypatch.setattr(viewer, "launch", opened.append)
    monkeypatch.setattr(sys, "argv", ["mujoco_plugin", *arguments])
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("spheretwin.mujoco_plugin", run_name="__main__")
    assert (ended.value.code, capsys.readouterr().err.count("\n")) == (code, lines)
    assert [model.nu for model in opened] == ([] if code else [18])
