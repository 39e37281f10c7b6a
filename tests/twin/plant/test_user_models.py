"""Physics that a user writes into the model acts as in the stock engine, or is refused in one line."""

import mujoco
import numba
import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.joint_chain import JointChain, fill_chain
from spheretwin.models.kinematics import generalised_torque
from spheretwin.plant.lagrangian_rotor import LagrangianRotor
from spheretwin.plant.lagrangian_rotor import step as lagrangian_step
from spheretwin.plant.mass_properties import true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor, step
from spheretwin.session import Session
from spheretwin.simulation import simulate
from tests.models.model_files import edited
from tests.twin.plant import user_models as models
from tests.twin.plant.motions import ideal_rotor

STEP_S = 5e-4
POSE, RATES = np.array([0.1, -0.05, 0.2]), np.array([0.2, 0.3, -0.5])
TORQUE_Q = np.array([0.03, -0.01, 0.08])


@pytest.fixture
def written(tmp_path):
    """Write a model with edits to a file of its own."""
    return lambda edits=(): edited(tmp_path, *edits, name=f"model_{len(list(tmp_path.iterdir()))}.xml")


def stock(path, torques, pose=POSE, rates=RATES, integrator="RK4"):
    """Poses as the engine alone gives them: the file as it is, with the clock and the switches of a run.

    `torques` has one row a step, on the hinges.
    """
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = STEP_S
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = pose, rates
    poses = np.empty((len(torques), 3))
    for row, torque in enumerate(torques):
        data.qfrc_applied[:] = torque
        mujoco.mj_step(model, data)
        poses[row] = data.qpos
    assert not any(warning.number for warning in data.warning)
    return poses


def ours(path, torques, pose=POSE, rates=RATES, integrator="RK4", payload_kg=0.0):
    rotor = MujocoRotor([true_model(mjcf.read(path), payload_kg=payload_kg)], STEP_S, integrator)
    engine = rotor.start(pose, rates)
    poses = np.empty((len(torques), 3))
    for row, torque in enumerate(torques):
        engine.torque_q[:] = torque
        step(engine)
        poses[row] = engine.q
    return poses


CONSTANT = np.tile(TORQUE_Q, (400, 1))


# No tolerance: bodies, geoms and sites that do nothing take part in no sum, so the steps are the same
# operations on the same numbers, the solver's with its warm start too.
@pytest.mark.parametrize("case", models.CASES.values(), ids=models.CASES)
def test_a_piece_of_physics_acts_as_in_the_stock_engine_and_is_named(written, case):
    path, without = written(case.edits), written(case.without)
    actuators.load(path)
    expected = stock(path, CONSTANT)
    # It does act: far above rounding within these 0.2 s.
    assert np.abs(expected - stock(without, CONSTANT)).max() > 1e-4
    np.testing.assert_array_equal(ours(path, CONSTANT), expected)
    for integrator in ("Euler", "implicitfast"):
        expected = stock(path, CONSTANT[:100], integrator=integrator)
        np.testing.assert_array_equal(ours(path, CONSTANT[:100], integrator=integrator), expected)
    # The closed forms lack it. The name is of this piece: without it, unless the rest has one of the same
    # kind, it is not said.
    named, others = (mjcf.beyond_a_free_rotor(mjcf.read(file).loaded) for file in (path, without))
    assert any(name.startswith(case.name) for name in named)
    assert any(name.startswith(case.name) for name in others) == (others == named)


@numba.njit
def constant_torque(t, reference, measurement, parameters, state, torque):
    for axis in range(3):
        torque[axis] = parameters[axis]


def scenario_of(path, **overrides):
    # One physics step a tick: the telemetry has every torque that acted.
    changes = {"plant.mjcf": str(path), "controller.period_s": STEP_S, "duration": 0.1}
    changes |= {"plant.initial_rad": POSE, "plant.initial_rad_s": RATES}
    return scenarios.load("hold", changes | overrides)


def check_against_the_stock_engine(path, table, tolerance):
    """Compare poses with those of the stock engine under the torques that the telemetry says acted."""
    middle = table["q_rad"] + 0.5 * STEP_S * table["qdot_rad_s"]
    torques = np.empty_like(middle)
    for row, (q, torque_S) in enumerate(zip(middle, table["torque_Nm"], strict=True)):
        generalised_torque(q, torque_S, torques[row])
    torques -= table["disturbance_Nm"]
    expected = np.vstack([POSE, stock(path, torques)[:-1]])
    np.testing.assert_allclose(table["q_rad"], expected, rtol=0, atol=tolerance)


GENERAL_JOINT = pytest.mark.release("compiles a loop for 9 s; its steps are compared in less")


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=[GENERAL_JOINT] if 'name="load"' in case.edits[-1][1] else [])
        for case in models.CASES.values()
    ],
    ids=models.CASES,
)
def test_a_run_is_what_the_stock_engine_makes_of_it_and_goes_on_from_a_snapshot(written, case):
    path = written(case.edits)
    law = Law("none", constant_torque, np.zeros(3), np.zeros(0))
    with Session(scenario_of(path), law) as session:
        start = session.advance(50)
        snapshot = session.snapshot()
        rest = session.advance(100)
        session.restore(snapshot)
        np.testing.assert_array_equal(session.advance(100).values, rest.values)
    # No tolerance: the same operations in the same order.
    names = ("q_rad", "qdot_rad_s", "torque_Nm", "disturbance_Nm")
    table = {name: np.concatenate([start[name], rest[name]]) for name in names}
    check_against_the_stock_engine(path, table, 0.0)


# The torque of the coils is computed once more here, with products and sums that are fused or not.
@pytest.mark.parametrize(
    "step",
    [
        constant_torque,
        pytest.param(
            constant_torque.py_func,
            marks=pytest.mark.release("4 s of plain Python; the other row has compiled laws"),
        ),
    ],
    ids=["compiled", "plain"],
)
def test_a_law_meets_the_same_physics(written, step):
    path = written(models.CASES["frictionloss"].edits)
    table = simulate(scenario_of(path), law=Law("constant", step, TORQUE_Q, np.zeros(0))).telemetry
    assert np.any(table["torque_Nm"])
    check_against_the_stock_engine(path, table, 1e-12)


def test_what_the_lagrangian_does_not_know_is_refused_in_one_line(written, capsys):
    path = str(written(models.CASES["armature"].edits))
    run = ["simulate", "hold", "--plant.engine", "lagrangian", "--plant.mjcf", path]
    for command in (["crosscheck", "--mjcf", path], run):
        assert cli.main(command) == cli.BAD_INPUT
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert "armature" in err


@pytest.mark.parametrize(("edits", "name"), models.GENERAL.values(), ids=models.GENERAL)
def test_mass_properties_and_hinges_of_a_file_act_in_both_engines(written, actuator, edits, name):
    path = written(edits)
    expected = stock(path, CONSTANT)
    assert np.abs(expected - stock(actuators.MJCF_PATH, CONSTANT)).max() > 1e-4
    np.testing.assert_array_equal(ours(path, CONSTANT), expected)
    joint = JointChain.filled(fill_chain, true_model(mjcf.read(path), 0.0, 0.0, 9.81, None))
    # Rounding of two engines over 400 steps; without these properties they differ by 1e-6 or more.
    final = equations_of_motion(LagrangianRotor(joint, STEP_S))
    np.testing.assert_allclose(final, expected[-1], rtol=0, atol=1e-10)
    # The closed forms of the cross-check do not describe the model.
    assert any(part.startswith(name) for part in mjcf.beyond_an_ideal_joint(mjcf.read(path).loaded))


def equations_of_motion(rotor):
    """Pose that the equations of motion reach under the constant torque."""
    data = rotor.start(POSE, RATES)
    data.torque_q[:] = TORQUE_Q
    for _ in CONSTANT:
        lagrangian_step(data)
    return data.q


def test_the_shipped_model_and_its_scene_hold_nothing_beyond_a_free_rotor():
    for path in (actuators.MJCF_PATH, actuators.FOLDER / "scene.xml"):
        original = mjcf.read(path)
        for model in (original.described, original.loaded, original.bare):
            assert mjcf.beyond_a_free_rotor(model) == []


@pytest.mark.parametrize("edits", models.IDLE.values(), ids=models.IDLE)
def test_what_moves_nothing_changes_nothing(written, edits):
    path = written(edits)
    np.testing.assert_array_equal(ours(path, CONSTANT), stock(actuators.MJCF_PATH, CONSTANT))
    assert mjcf.beyond_a_free_rotor(mjcf.read(path).loaded) == []
    assert simulate(scenario_of(path, duration=0.01)).status == "completed"


def test_what_moves_nothing_costs_nothing():
    # Sites, sensors, drawn geoms and the empty mount each cost time in every stage of a step.
    bare = mjcf.read(actuators.MJCF_PATH).bare
    assert (bare.nsite, bare.nsensor, bare.ngeom, bare.nbody) == (0, 0, 0, 5)


@pytest.mark.parametrize("edits", models.INERTIAS.values(), ids=models.INERTIAS)
def test_inertia_from_geoms_is_the_rotor_s(written, edits):
    path = written(edits)
    result = actuators.load(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data, M = mujoco.MjData(model), np.empty((3, 3))
    mujoco.mj_forward(model, data)
    for column, unit in zip(M, np.eye(3), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    # At the first pose M is diagonal, with the rotor's inertias; the rings add 1e-12 of them.
    np.testing.assert_allclose(np.diag(result.inertia), M, rtol=1e-11, atol=1e-17)
    assert len(set(np.round(np.diag(M), 9))) == (1 if "sphere" in edits[0][1][:24] else 3)
    # Where axes were turned back, sums are taken in another order; 0.2 s blow that up a little.
    np.testing.assert_allclose(ours(path, CONSTANT), stock(path, CONSTANT), rtol=0, atol=1e-12)
    assert mjcf.beyond_a_free_rotor(mjcf.read(path).loaded) == []
    # Rounding, and the rings that only the engine has: 1e-12 of a move of some radians.
    final = equations_of_motion(ideal_rotor(result, STEP_S))
    np.testing.assert_allclose(final, ours(path, CONSTANT)[-1], rtol=0, atol=1e-10)


def test_inertia_from_geoms_that_collide_is_whole(written):
    # One of both geoms is only drawn; the engine leaves its shape out, and must keep its mass.
    both = models.box("0.03 0.04 0.045", 1.5) + models.BALL_INSIDE.format(models.COLLIDING)
    path = written((*models.CONTACTS, (models.INERTIAL, both)))
    np.testing.assert_array_equal(ours(path, CONSTANT), stock(path, CONSTANT))
    drawn = written(((models.INERTIAL, models.box("0.03 0.04 0.045", 1.5) + models.BALL_INSIDE.format("")),))
    np.testing.assert_array_equal(actuators.load(path).inertia, actuators.load(drawn).inertia)


@pytest.mark.parametrize(("edits", "inside"), models.ON_THE_MOUNT.values(), ids=models.ON_THE_MOUNT)
def test_a_payload_acts_as_one_in_the_file(written, edits, inside):
    empty = models.after(models.MOUNT, inside)
    full = ((models.EMPTY, models.EMPTY.replace('mass="0"', 'mass="0.05"') + inside),)
    expected = stock(written(edits + full), CONSTANT)
    assert np.abs(expected - stock(written(edits + empty), CONSTANT)).max() > 1e-4
    np.testing.assert_array_equal(ours(written(edits + empty), CONSTANT, payload_kg=0.05), expected)


def test_a_state_that_is_not_finite_is_counted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its own log into the current folder
    rotor = MujocoRotor([true_model(mjcf.read(actuators.MJCF_PATH))], STEP_S, "RK4")
    engine = rotor.start(np.zeros(3), np.zeros(3))
    assert engine.warnings == 0
    engine.qdot[0] = 1e11
    step(engine)
    assert engine.warnings == rotor.data.warning.number[mujoco.mjtWarning.mjWARN_BADQVEL] == 1
