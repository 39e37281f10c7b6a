"""Physics that a user writes into the model acts as in the stock engine, or is refused in one line."""

import contextlib
import io
import re
from typing import NamedTuple

import mujoco
import numba
import numpy as np
import pytest

from spheretwin.control.law import Law
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.base.errors import InputError
from spheretwin.twin import cli
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.plant.engine import Rotor, step
from spheretwin.twin.plant.lagrangian import LagrangianRotor
from spheretwin.twin.plant.lagrangian import step as lagrangian_step
from spheretwin.twin.session import Session
from spheretwin.twin.simulation import simulate

STEP_S = 5e-4
POSE, RATES = np.array([0.1, -0.05, 0.2]), np.array([0.2, 0.3, -0.5])
TORQUE_Q, TORQUE_S = np.array([0.01, -0.02, 0.03]), np.array([0.02, 0.01, 0.05])

MESHES = f'meshdir="{actuators.FOLDER / "assets"}"'
TEXT = actuators.MJCF_PATH.read_text(encoding="utf-8").replace('meshdir="assets"', MESHES)

# Where a piece of physics is put in.
COMPILER = "<compiler "
OPTION = '<option integrator="RK4" '
FLAGS = '<flag autoreset="disable" contact="disable"/>'
WORLD = "<worldbody>"
STATOR = '<geom name="stator" class="rotor_shell" mesh="stator" rgba="0.45 0.50 0.56 1"/>'
ALPHA = '<joint name="alpha" class="tilt_hinge" axis="1 0 0"/>'
GAMMA = '<joint name="gamma" axis="0 0 1"/>'
INERTIAL = '<inertial pos="0 0 0" mass="1.6" diaginertia="2.219e-3 2.176e-3 2.256e-3"/>'
TIP = '<site name="shaft_tip" class="marker" pos="0 0 0.12"/>'
BALL = '<geom name="ball" class="rotor_shell" mesh="ball"/>'
MOUNT = '<geom name="payload" type="cylinder" size="0.009 0.006" rgba="0.95 0.75 0.15 1"/>'
EMPTY = '<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/>\n              ' + MOUNT
RING = 'mass="2e-15" diaginertia="1.1e-15 1.1e-15 1.1e-15"/>'
END = "</mujoco>"

Edits = tuple[tuple[str, str], ...]


def edited(edits: Edits) -> str:
    text = TEXT
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new)
    return text


def with_attributes(tag: str, attributes: str) -> Edits:
    return ((tag, tag.replace("/>", f" {attributes}/>")),)


def after(tag: str, addition: str) -> Edits:
    return ((tag, tag + addition),)


def at_the_end(section: str) -> Edits:
    return ((END, section + END),)


class Case(NamedTuple):
    """A piece of physics, what it is called, and the model without it where that is not the shipped one."""

    edits: Edits
    name: str
    without: Edits = ()


# The engine takes a body for a box of its inertia and mass: that of the rings as shipped is 1.8 m wide.
THIN_RINGS = ((RING, RING.replace("2e-15", "1e-6")),)
CONTACTS = ((FLAGS, '<flag autoreset="disable"/>'),)
COLLIDING = 'contype="1" conaffinity="1"'
ARM = '<geom name="arm" type="sphere" size="0.01" pos="0.05 0 0.1" {}/>'
POST = '<geom name="post" type="sphere" size="0.02" pos="{} -0.035 0.1" {}/>'
ANCHOR = '<site name="anchor" pos="0.1 0 0.1"/>'
LOAD = '<body name="load" pos="0.02 0 0.05" {}><geom type="box" size="0.01 0.01 0.01" mass="0.05"/></body>'
POINT = '<body name="point" pos="0.02 0 0.05"><inertial pos="0 0 0" mass="0.05" diaginertia="0 0 0"/></body>'
DISC = '<geom type="ellipsoid" size="0.05 0.03 0.04" {}/>'
PID = (
    '<extension><plugin plugin="mujoco.pid"><instance name="pid"><config key="kp" value="0.4"/>'
    '<config key="ki" value="1"/></instance></plugin></extension>'
)


def fluid(attributes: str) -> Edits:
    return ((OPTION, f"{OPTION}{attributes} "), *THIN_RINGS)


def hinge(attributes: str) -> Edits:
    return with_attributes(GAMMA, attributes)


def spatial_tendon(attributes: str, site: str = "shaft_tip", between: str = "") -> Edits:
    path = f'<site site="anchor"/>{between}<site site="{site}"/>'
    return at_the_end(f"<tendon><spatial {attributes}>{path}</spatial></tendon>")


def fixed_tendon(attributes: str) -> Edits:
    joints = '<joint joint="gamma" coef="1"/><joint joint="alpha" coef="-1"/>'
    return at_the_end(f"<tendon><fixed {attributes}>{joints}</fixed></tendon>")


def actuator(inside: str) -> Edits:
    return at_the_end(f"<actuator>{inside}</actuator>")


def equality(inside: str) -> Edits:
    return at_the_end(f"<equality>{inside}</equality>")


CASES = {
    "frictionloss": Case(hinge('frictionloss="0.1"'), "frictionloss"),
    "frictionloss of a tilt hinge": Case(with_attributes(ALPHA, 'frictionloss="0.01"'), "frictionloss"),
    "stiffness": Case(hinge('stiffness="0.2"'), "stiffness"),
    "springref": Case(hinge('stiffness="0.2" springref="20"'), "stiffness", hinge('stiffness="0.2"')),
    "damping": Case(hinge('damping="0.05"'), "damping"),
    "damping of higher order": Case(hinge('damping="0 0.05"'), "damping"),
    "armature": Case(hinge('armature="0.001"'), "armature"),
    "limit margin": Case(with_attributes(ALPHA, 'margin="80"'), "limit margin"),
    "equality of joints": Case(
        equality('<joint joint1="gamma" joint2="alpha" polycoef="0 0.5 0 0 0"/>'), "equality"
    ),
    "equality of bodies": Case(
        equality('<connect body1="rotor" body2="stator" anchor="0 0 0.03" solref="0.2 1"/>'), "equality"
    ),
    "equality of sites": Case(
        after(STATOR, '<site name="above" pos="0 0 0.12"/>')
        + equality('<connect site1="shaft_tip" site2="above" solref="0.2 1"/>'),
        "equality",
    ),
    "weld of the mount": Case(equality('<weld body1="payload" body2="stator" solref="0.2 1"/>'), "equality"),
    "weld to a mocap body": Case(
        after(WORLD, '<body name="held" mocap="true" pos="0 0 0.1"/>')
        + equality('<connect body1="rotor" body2="held" anchor="0 0 0.1" solref="0.2 1"/>')
        + at_the_end('<keyframe><key qpos="0 0 1" mpos="0 0 1"/></keyframe>'),
        "equality",
    ),
    "fixed tendon": Case(fixed_tendon('stiffness="0.3" damping="0.01"'), "tendon"),
    "fixed tendon with friction": Case(fixed_tendon('frictionloss="0.02"'), "tendon"),
    "fixed tendon with a limit": Case(fixed_tendon('limited="true" range="-0.1 0.1"'), "tendon"),
    "spatial tendon": Case(
        after(STATOR, ANCHOR) + spatial_tendon('stiffness="30" springlength="0.01"'), "tendon"
    ),
    "spatial tendon with friction": Case(
        after(STATOR, ANCHOR) + spatial_tendon('frictionloss="0.5"'), "tendon"
    ),
    "spatial tendon with a limit": Case(
        after(STATOR, ANCHOR) + spatial_tendon('limited="true" range="0 0.09"'), "tendon"
    ),
    "spatial tendon over what is only drawn": Case(
        after(STATOR, ANCHOR.replace("0 0.1", "0 0.05") + '<geom name="drum" type="sphere" size="0.105"/>')
        + spatial_tendon('stiffness="30"', between='<geom geom="drum"/>'),
        "tendon",
        after(STATOR, ANCHOR.replace("0 0.1", "0 0.05")) + spatial_tendon('stiffness="30"'),
    ),
    "spatial tendon on the mount": Case(
        after(STATOR, ANCHOR)
        + after(MOUNT, '<site name="eye"/>')
        + spatial_tendon('stiffness="30"', site="eye"),
        "tendon",
    ),
    "density": Case(fluid('density="1000"'), "fluid"),
    "viscosity": Case(fluid('viscosity="5"'), "fluid"),
    "wind": Case(fluid('density="1000" wind="2 3 0"') + after(TIP, LOAD.format("")), "fluid",
                 fluid('density="1000"') + after(TIP, LOAD.format(""))),
    "drag of a shape that is only drawn": Case(
        fluid('viscosity="1"') + after(TIP, DISC.format('fluidshape="ellipsoid"')),
        "fluid",
        fluid('viscosity="1"') + after(TIP, DISC.format("")),
    ),
    "contact": Case(
        CONTACTS
        + after(TIP, ARM.format(COLLIDING + ' mass="0.02"'))
        + after(STATOR, POST.format(0.05, COLLIDING)),
        "contact",
    ),
    "contact on the mount": Case(
        CONTACTS + with_attributes(MOUNT, COLLIDING) + after(STATOR, POST.format(0, COLLIDING)), "contact"
    ),
    "pair of what is only drawn": Case(
        CONTACTS
        + after(TIP, ARM.format(""))
        + after(STATOR, POST.format(0.05, ""))
        + at_the_end('<contact><pair geom1="arm" geom2="post"/></contact>'),
        "contact",
    ),
    "pair with the mount": Case(
        CONTACTS
        + after(STATOR, POST.format(0, ""))
        + at_the_end('<contact><pair geom1="payload" geom2="post"/></contact>'),
        "contact",
    ),
    "body on the rotor": Case(after(TIP, LOAD.format("")), "mass of body load"),
    "body on a ring": Case(
        after(ALPHA, LOAD.format("")), "mass of body load"
    ),
    "body without a name": Case(
        after(TIP, LOAD.format("").replace('name="load" ', "")), "mass of body number"
    ),
    "point mass": Case(after(TIP, POINT), "mass of body point"),
    "body on the mount": Case(after(MOUNT, LOAD.format("")), "mass of body load"),
    "gravity aslant": Case(
        ((OPTION, f'{OPTION}gravity="5 0 -9.81" '), *after(TIP, LOAD.format(""))),
        "gravity other than along -z",
        after(TIP, LOAD.format("")),
    ),
    "gravity upwards": Case(
        ((OPTION, f'{OPTION}gravity="0 0 9.81" '), *after(TIP, LOAD.format(""))),
        "gravity other than along -z",
        after(TIP, LOAD.format("")),
    ),
    "gravity compensation": Case(
        after(TIP, LOAD.format('gravcomp="0.5"')), "gravity compensation", after(TIP, LOAD.format(""))
    ),
    "position servo": Case(actuator('<position joint="gamma" kp="0.3" kv="0.01"/>'), "actuator"),
    "servo between sites": Case(
        after(STATOR, ANCHOR)
        + actuator('<position site="shaft_tip" refsite="anchor" kp="3" gear="1 0 0 0 0 0"/>'),
        "actuator",
    ),
    "servo on the mount": Case(
        after(STATOR, ANCHOR)
        + after(MOUNT, '<site name="eye"/>')
        + actuator('<position site="eye" refsite="anchor" kp="3" gear="1 0 0 0 0 0"/>'),
        "actuator",
    ),
    "bias of an actuator": Case(
        actuator('<general joint="gamma" biastype="affine" biasprm="0.05 -0.2 0"/>'), "actuator"
    ),
    "damping of an actuator": Case(actuator('<motor joint="gamma" damping="0.02"/>'), "actuator"),
    "armature of an actuator": Case(actuator('<motor joint="gamma" armature="0.001"/>'), "actuator"),
    "actuator with a state": Case(
        actuator('<general joint="gamma" dyntype="filter" dynprm="0.1" biastype="affine" biasprm="0.05"/>'),
        "actuator",
    ),
    "plugin": Case(
        ((COMPILER, f"{PID}{COMPILER}"), *actuator('<plugin joint="gamma" actdim="1" instance="pid"/>')),
        "plugin",
    ),
}  # fmt: skip

each_case = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


@pytest.fixture
def written(tmp_path):
    """Write a model with edits to a file of its own."""
    count = 0

    def write(edits: Edits = ()):
        nonlocal count
        count += 1
        (path := tmp_path / f"model_{count}.xml").write_text(edited(edits), encoding="utf-8")
        return path

    return write


def stock(path, torques, pose=POSE, rates=RATES, integrator="RK4"):
    """Poses as the engine alone gives them: the file as it is, with the clock and the switches of a run.

    `torques` has one row a step: on the hinges, then on the rotor in the stator frame.
    """
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = STEP_S
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = pose, rates
    poses = np.empty((len(torques), 3))
    for row, torque in enumerate(torques):
        data.qfrc_applied[:] = torque[:3]
        data.xfrc_applied[model.body("rotor").id, 3:] = torque[3:]
        mujoco.mj_step(model, data)
        poses[row] = data.qpos
    assert not any(warning.number for warning in data.warning)
    return poses


def ours(path, torques, pose=POSE, rates=RATES, integrator="RK4", payload_kg=0.0):
    rotor = Rotor(mjcf.read(path), STEP_S, integrator, 0.0, payload_kg)
    engine = rotor.start(pose, rates)
    poses = np.empty((len(torques), 3))
    for row, torque in enumerate(torques):
        engine.torque_q[:], engine.torque_S[:] = torque[:3], torque[3:]
        step(engine)
        poses[row] = engine.q
    return poses


CONSTANT = np.tile(np.concatenate([TORQUE_Q, TORQUE_S]), (400, 1))


# No tolerance: bodies, geoms and sites that do nothing take part in no sum, so the steps are the same
# operations on the same numbers, the solver's with its warm start too.
@each_case
def test_a_piece_of_physics_acts_as_in_the_stock_engine(written, case):
    path = written(case.edits)
    actuators.load(path)
    expected = stock(path, CONSTANT)
    # It does act: far above rounding within these 0.2 s.
    assert np.abs(expected - stock(written(case.without), CONSTANT)).max() > 1e-4
    np.testing.assert_array_equal(ours(path, CONSTANT), expected)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
@each_case
def test_it_acts_under_the_other_integrators_too(written, case, integrator):
    path = written(case.edits)
    expected = stock(path, CONSTANT, integrator=integrator)
    np.testing.assert_array_equal(ours(path, CONSTANT, integrator=integrator), expected)


@numba.njit
def constant_torque(t, reference, measurement, parameters, state, torque):
    for axis in range(3):
        torque[axis] = parameters[axis]


def scenario_of(path, **overrides):
    # One physics step a tick: the telemetry has every torque that acted.
    changes = {"plant.mjcf": str(path), "controller.period_s": STEP_S, "duration": 0.1}
    changes |= {"plant.initial_rad": POSE, "plant.initial_rad_s": RATES}
    return scenarios.load("hold", changes | overrides)


def replayed(path, table):
    """Poses of the stock engine at each tick, under the torques that the telemetry says acted."""
    torques = np.hstack([-table["disturbance_Nm"], table["torque_Nm"]])
    return np.vstack([POSE, stock(path, torques)[:-1]])


@pytest.mark.parametrize("parameters", [np.zeros(3), TORQUE_Q], ids=["no torque", "constant torque"])
@each_case
def test_a_run_is_what_the_stock_engine_makes_of_its_torques(written, case, parameters):
    path = written(case.edits)
    law = Law("constant", constant_torque, parameters, np.zeros(0))
    finished = simulate(scenario_of(path), law)
    assert finished.status == "completed"
    assert np.any(finished.telemetry["torque_Nm"]) == np.any(parameters)
    np.testing.assert_array_equal(finished.telemetry["q_rad"], replayed(path, finished.telemetry))


def test_a_law_in_plain_python_meets_the_same_physics(written):
    path = written(CASES["frictionloss"].edits)
    law = Law("constant", constant_torque.py_func, TORQUE_Q, np.zeros(0))
    table = simulate(scenario_of(path), law).telemetry
    np.testing.assert_array_equal(table["q_rad"], replayed(path, table))


@each_case
def test_a_session_goes_on_from_a_snapshot_bit_for_bit(written, case):
    law = Law("constant", constant_torque, TORQUE_Q, np.zeros(0))
    with Session(scenario_of(written(case.edits)), law) as session:
        session.advance(50)
        kept = session.snapshot()
        first = session.advance(100).values.copy()
        session.restore(kept)
        np.testing.assert_array_equal(session.advance(100).values, first)


def refused(*arguments):
    """The one line of a command that is refused as bad input."""
    stdout, stderr = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        assert cli.main([*map(str, arguments)]) == cli.BAD_INPUT
    assert stdout.getvalue() == ""
    (line,) = stderr.getvalue().splitlines()
    return line


@each_case
def test_what_the_lagrangian_does_not_know_is_named_and_refused(written, case):
    path = written(case.edits)
    named = mjcf.beyond_a_free_rotor(mjcf.read(path).loaded)
    assert any(name.startswith(case.name) for name in named)
    # The name is of this piece: without it, unless the rest has one of the same kind, it is not said.
    without = mjcf.beyond_a_free_rotor(mjcf.read(written(case.without)).loaded)
    assert any(name.startswith(case.name) for name in without) == (without == named)
    with pytest.raises(InputError, match=re.escape(case.name)) as caught:
        Session(scenario_of(path, **{"plant.engine": "lagrangian"}))
    assert "\n" not in str(caught.value)
    assert case.name in refused("crosscheck", "--mjcf", path)
    assert case.name in refused("simulate", "hold", "--plant.mjcf", path, "--plant.engine", "lagrangian")


def test_the_shipped_model_and_its_scene_hold_nothing_beyond_a_free_rotor():
    for path in (actuators.MJCF_PATH, actuators.FOLDER / "scene.xml"):
        kept = mjcf.read(path)
        for model in (kept.described, kept.loaded, kept.bare):
            assert mjcf.beyond_a_free_rotor(model) == []


# What a user's file may hold beside its physics: it moves nothing, and keeps no file from being read.
IDLE = {
    "no flags": ((FLAGS, ""),),
    "no options": ((OPTION + 'timestep="0.0005">', "<option>"),),
    "keyframes": at_the_end('<keyframe><key name="tilted" qpos="0.1 0.2 0.3" qvel="1 2 3"/></keyframe>'),
    "tuple of a site": at_the_end(
        '<custom><tuple name="t"><element objtype="site" objname="shaft_tip"/></tuple></custom>'
    ),
    "tuple of the mount": at_the_end(
        '<custom><tuple name="t"><element objtype="body" objname="payload"/></tuple></custom>'
    ),
    "tuple of a sensor": at_the_end(
        '<custom><tuple name="t"><element objtype="sensor" objname="alpha_position"/></tuple></custom>'
    ),
    "sensors of sites": at_the_end(
        '<sensor><framepos objtype="site" objname="shaft_tip"/><accelerometer site="shaft_tip"/></sensor>'
    ),
    "camera at the mount": after(STATOR, '<camera mode="targetbody" target="payload"/>'),
    "light on the mount": after(MOUNT, '<light mode="targetbodycom" target="rotor"/>'),
    "exclusion of the mount": at_the_end('<contact><exclude body1="payload" body2="stator"/></contact>'),
    "wind without air": ((OPTION, f'{OPTION}wind="3 0 0" magnetic="0 0 1" '),),
    "solver": ((OPTION, f'{OPTION}solver="CG" cone="elliptic" iterations="3" impratio="10" '),),
    "flags": ((FLAGS, '<flag contact="disable" energy="enable" sleep="enable" limit="disable"/>'),),
}


@pytest.mark.parametrize("edits", IDLE.values(), ids=IDLE)
def test_what_moves_nothing_changes_nothing(written, edits):
    path = written(edits)
    np.testing.assert_array_equal(ours(path, CONSTANT), stock(actuators.MJCF_PATH, CONSTANT))
    assert mjcf.beyond_a_free_rotor(mjcf.read(path).loaded) == []
    assert simulate(scenario_of(path, duration=0.01)).status == "completed"


def test_a_missing_mesh_that_is_only_drawn_moves_nothing(written):
    path = written((("ball.obj", "nowhere.obj"),))
    np.testing.assert_array_equal(ours(path, CONSTANT), stock(actuators.MJCF_PATH, CONSTANT))


def test_what_moves_nothing_costs_nothing():
    # Sites, sensors, drawn geoms and the empty mount each cost time in every stage of a step.
    bare = mjcf.read(actuators.MJCF_PATH).bare
    assert (bare.nsite, bare.nsensor, bare.ngeom, bare.nbody) == (0, 0, 0, 5)


@pytest.mark.parametrize(("frictionloss", "angle"), [("0.2", 0.0229), ("0", 5.54)])
def test_friction_of_a_hinge_holds_what_pushes_less(written, frictionloss, angle):
    path = written(hinge(f'frictionloss="{frictionloss}"'))
    push = np.tile([0, 0, 0.1, 0, 0, 0], (1000, 1))
    turned = ours(path, push, np.zeros(3), np.zeros(3))[-1, 2]
    # Without friction t²/2 of 0.1 N·m over 2.256e-3 kg·m²; with it, the creep of a soft constraint: by the
    # engine alone, to the digits given.
    assert turned == pytest.approx(angle, rel=2e-3)


def box(sizes, mass):
    return f'<geom type="box" size="{sizes}" mass="{mass}"/>'


BALL_INSIDE = '<geom type="sphere" size="0.03" mass="0.5" {}/>'
GRAINS = ((RING, RING + '<geom type="sphere" size="0.002" mass="1e-9"/>'),)  # rings must have a mass

INERTIAS = {
    "sphere": ((INERTIAL, '<geom type="sphere" size="0.04" mass="1.5"/>'),),
    "box": ((INERTIAL, box("0.045 0.03 0.04", 1.5)),),
    "box and sphere": ((INERTIAL, box("0.03 0.04 0.045", 1.5) + BALL_INSIDE.format("")),),
    "axes in another order": ((INERTIAL, box("0.045 0.03 0.04", 1.5) + BALL_INSIDE.format("")),),
    "axes in a third order": ((INERTIAL, box("0.04 0.045 0.03", 1.5) + BALL_INSIDE.format("")),),
    "by force": (
        (COMPILER, '<compiler inertiafromgeom="true" '),
        *GRAINS,
        *after(INERTIAL, box("0.03 0.04 0.045", 1.5)),
    ),
    "by force, axes in another order": (
        (COMPILER, '<compiler inertiafromgeom="true" '),
        *GRAINS,
        *after(INERTIAL, box("0.045 0.03 0.04", 1.5) + BALL_INSIDE.format("")),
    ),
    "full matrix": ((INERTIAL, '<inertial pos="0 0 0" mass="1" fullinertia="1e-3 3e-3 2.5e-3 0 0 0"/>'),),
}


@pytest.mark.parametrize("edits", INERTIAS.values(), ids=INERTIAS)
def test_inertia_from_geoms_is_the_rotor_s(written, edits):
    path = written(edits)
    found = actuators.load(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data, M = mujoco.MjData(model), np.empty((3, 3))
    mujoco.mj_forward(model, data)
    for column, unit in zip(M, np.eye(3), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    # At the first pose M is diagonal, with the rotor's inertias; the rings add 1e-12 of them.
    np.testing.assert_allclose(np.diag(found.inertia), M, rtol=1e-11, atol=1e-17)
    assert len(set(np.round(np.diag(M), 9))) == (1 if "sphere" in edits[0][1][:24] else 3)
    # Where axes were turned back, sums are taken in another order; 0.2 s blow that up a little.
    np.testing.assert_allclose(ours(path, CONSTANT), stock(path, CONSTANT), rtol=0, atol=1e-12)
    assert mjcf.beyond_a_free_rotor(mjcf.read(path).loaded) == []
    equations = LagrangianRotor(found, STEP_S).start(POSE, RATES)
    equations.torque_q[:], equations.torque_S[:] = TORQUE_Q, TORQUE_S
    for _ in CONSTANT:
        lagrangian_step(equations)
    # Rounding, and the rings that only the engine has: 1e-12 of a move of some radians.
    np.testing.assert_allclose(equations.q, ours(path, CONSTANT)[-1], rtol=0, atol=1e-10)


def test_inertia_from_geoms_that_collide_is_whole(written):
    # One of both geoms is only drawn; the engine leaves its shape out, and must keep its mass.
    both = box("0.03 0.04 0.045", 1.5) + BALL_INSIDE.format(COLLIDING)
    path = written((*CONTACTS, (INERTIAL, both)))
    np.testing.assert_array_equal(ours(path, CONSTANT), stock(path, CONSTANT))
    drawn = written(((INERTIAL, box("0.03 0.04 0.045", 1.5) + BALL_INSIDE.format("")),))
    np.testing.assert_array_equal(actuators.load(path).inertia, actuators.load(drawn).inertia)


ON_THE_MOUNT = {
    "nothing": ((), ""),
    "site": ((), '<site name="eye"/>'),
    "body": ((), LOAD.format("")),
    "shape in a fluid": (fluid('viscosity="1"'), DISC.format('fluidshape="ellipsoid"')),
}


@pytest.mark.parametrize(("edits", "inside"), ON_THE_MOUNT.values(), ids=ON_THE_MOUNT)
def test_a_payload_acts_as_one_in_the_file(written, edits, inside):
    empty, full = after(MOUNT, inside), ((EMPTY, EMPTY.replace('mass="0"', 'mass="0.05"') + inside),)
    expected = stock(written(edits + full), CONSTANT)
    assert np.abs(expected - stock(written(edits + empty), CONSTANT)).max() > 1e-4
    np.testing.assert_array_equal(ours(written(edits + empty), CONSTANT, payload_kg=0.05), expected)


REFUSED = {
    "ref": (hinge('ref="10"'), "hinges without ref"),
    "mass of the mount": (((EMPTY, MOUNT.replace("/>", ' mass="0.05"/>')),), "empty payload mount"),
    "inertia of the mount": (
        ((EMPTY, EMPTY.replace('"0 0 0"/>', '"1e-3 1e-3 1e-3"/>').replace('pos="1e-3 1e-3 1e-3"', "")),),
        "empty payload mount",
    ),
    "rotor off its centre": (((INERTIAL, '<geom type="sphere" size="0.04" pos="0 0 0.001" mass="1"/>'),),
                             "centre of mass at the origin"),
    "oblique axes": (((INERTIAL, '<geom type="box" size="0.03 0.04 0.045" euler="10 0 0" mass="1"/>'),),
                     "principal axes along its own"),
    "fourth joint": (after(TIP, LOAD.format("").replace("><geom", '><joint axis="1 0 0"/><geom')),
                     "three degrees of freedom, received 4"),
    "joint of the mount": (((EMPTY, '<joint axis="1 0 0"/>' + MOUNT.replace("/>", ' mass="0.05"/>')),),
                           "three degrees of freedom, received 4"),
    "missing mesh that is heavy": (
        (("ball.obj", "nowhere.obj"), (INERTIAL, ""), *with_attributes(BALL, 'mass="1"')), "nowhere.obj"
    ),
    "missing mesh that collides": (
        (("shaft.obj", "nowhere.obj"), ('mesh="shaft"', f'mesh="shaft" {COLLIDING}')), "nowhere.obj"
    ),
    "name that no mesh can have": ((("pole.obj", "x" * 5000 + ".obj"),), "expected an MJCF file"),
    "missing include": (after(WORLD, '<include file="nowhere.xml"/>'), "nowhere.xml"),
}  # fmt: skip


@pytest.mark.parametrize(("edits", "part"), REFUSED.values(), ids=REFUSED)
def test_what_the_twin_cannot_hold_is_refused_in_one_line(written, edits, part):
    path = written(edits)
    with pytest.raises(InputError, match=re.escape(part)) as caught:
        Session(scenario_of(path))
    assert "\n" not in str(caught.value)
    assert part in refused("simulate", "hold", "--plant.mjcf", path)
    assert part in refused("crosscheck", "--mjcf", path)
