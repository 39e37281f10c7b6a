"""Mass properties and hinges of the true rotor: what is drawn, what it does, and that both engines agree."""

import mujoco
import numpy as np
import pytest

from spheretwin import linearise
from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.loop import assembly
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.base.errors import InputError
from spheretwin.models.joint_chain import JointChain, equations, fill_chain
from spheretwin.plant import bristle_friction as bearing
from spheretwin.plant import lagrangian_rotor, mujoco_rotor
from spheretwin.plant.cable import CableSection
from spheretwin.plant.friction import slow_down
from spheretwin.plant.lagrangian_rotor import LagrangianRotor
from spheretwin.plant.mass_properties import MassSection, mass_errors, true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor
from spheretwin.session import Session
from tests.models.model_files import edited, edited_text
from tests.models.test_joint_chain import full
from tests.twin.plant import user_models as models
from tests.twin.plant.motions import STEP_s, friction

EVERYTHING = {
    "centre_m": (1e-3, -2e-3, 5e-4),
    "centre_error_m": 1e-3,
    "products_kg_m2": (1e-4, -5e-5, 2e-5),
    "product_error_kg_m2": 5e-5,
    "ring_inertia_kg_m2": ((4e-4, 2e-4, 3e-4), (2e-4, 3e-4, 2e-4)),
    "axis_tilt_rad": ((0.01, 0.0), (0.0, -0.01), (5e-3, 5e-3)),
    "axis_tilt_error_rad": 5e-3,
    "axis_offset_m": ((1e-4, 0.0), (0.0, 2e-4), (1e-4, 1e-4)),
    "axis_offset_error_m": 1e-4,
}
FIELDS = {f"plant.mass.{name}": value for name, value in EVERYTHING.items()}


SHIPPED = mjcf.read(actuators.MJCF_PATH)


def chain_of(section, modelling_error=0.0, payload_kg=0.0, gravity_m_s2=9.81, seed=0):
    errors = mass_errors(section, seed)
    return JointChain.filled(
        fill_chain, true_model(SHIPPED, modelling_error, payload_kg, gravity_m_s2, errors)
    )[0]


def upright(chain):
    return full(equations(chain, (0.0,) * 3, (0.0,) * 3)[0])


@pytest.mark.parametrize("engine", ["mujoco", "lagrangian"])
@pytest.mark.parametrize(
    ("fields", "general", "skewed"),
    [({}, False, False), ({"plant.mass.centre_m": [1e-3, 0.0, 0.0]}, True, False), (FIELDS, True, True)],
    ids=["ideal", "offset centre", "everything"],
)
def test_the_plant_has_general_parts_only_if_it_needs_them(engine, fields, general, skewed):
    changes = fields | {"plant.engine": engine, "plant.payload_kg": 0.05}
    with Session(scenarios.load("hold", changes)) as session:
        plant = session._runtime._plant
    joint = plant.rotor.joint
    assert (joint.is_tilted, joint.on) == (skewed, general)


def test_inertia_of_the_rotor_upright_is_the_sum_of_its_parts(actuator):
    centre, (xy, xz, yz) = np.array([1e-3, -2e-3, 5e-4]), (1e-4, -5e-5, 2e-5)
    outer, inner = (4e-4, 2e-4, 3e-4), (2e-4, 3e-4, 2e-4)
    parts = {"products_kg_m2": (xy, xz, yz), "ring_inertia_kg_m2": (outer, inner)}
    section = MassSection(centre_m=tuple(centre), **parts)
    expected = 1.2 * np.diag(actuator.inertia) + [[0, xy, xz], [xy, 0, yz], [xz, yz, 0]]
    expected += 1.6 * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    expected[0, 0] += outer[0] + inner[0]
    expected[1, 1] += inner[1]
    # The moments of a ring about axes on which it does not turn have no effect upright. Rounding, and the
    # model's own rings of 1e-15.
    result = upright(chain_of(section, modelling_error=0.2))
    np.testing.assert_allclose(result, expected, rtol=0, atol=1e-14)


def test_hinges_stand_where_the_fields_say():
    tilt, offset = ((0.01, 0.02), (-0.01, 0.03), (0.02, -0.03)), ((1e-4, 2e-4), (-1e-4, 0.0), (3e-4, 1e-4))
    chain = chain_of(MassSection(axis_tilt_rad=tilt, axis_offset_m=offset))
    expected = np.array([[1, 0.01, 0.02], [-0.01, 1, 0.03], [0.02, -0.03, 1]])
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    np.testing.assert_allclose(chain.axes, expected, rtol=0, atol=1e-15)
    expected = [[0, 1e-4, 2e-4], [-1e-4, 0, 0], [3e-4, 1e-4, 0]]
    np.testing.assert_allclose(chain.points, expected, rtol=0, atol=1e-18)


def test_errors_are_uniform_within_their_bounds_and_added_to_the_given_values():
    section = MassSection(**EVERYTHING)
    drawn = [mass_errors(section, seed) for seed in range(400)]
    centres = np.array([machine.centre_m for machine in drawn]) - EVERYTHING["centre_m"]
    assert np.abs(centres).max() <= EVERYTHING["centre_error_m"]
    # Mean and spread of 1,200 uniform numbers: three standard deviations of each.
    assert abs(centres.mean()) < 3 * 1e-3 / np.sqrt(3 * 1200)
    assert np.std(centres) == pytest.approx(1e-3 / np.sqrt(3), rel=0.05)
    tilts = np.array([machine.axis_tilt_rad for machine in drawn]) - EVERYTHING["axis_tilt_rad"]
    assert tilts.shape == (400, 3, 2)
    assert len(np.unique(tilts)) == tilts.size
    assert np.abs(tilts).max() <= EVERYTHING["axis_tilt_error_rad"]


def test_the_stream_of_a_quantity_does_not_depend_on_the_others():
    alone = mass_errors(MassSection(axis_offset_error_m=1e-4), 7)
    together = mass_errors(MassSection(axis_offset_error_m=1e-4, centre_error_m=1e-3), 7)
    np.testing.assert_array_equal(alone.axis_offset_m, together.axis_offset_m)
    assert not np.any(alone.centre_m)
    other = mass_errors(MassSection(axis_offset_error_m=1e-4), 8)
    assert not np.any(other.axis_offset_m == alone.axis_offset_m)


def assert_same_steps(first, second, start):
    """Compare 400 steps of a rotor of MuJoCo and one of the equations of motion."""
    data = [rotor.start(*map(np.array, start)) for rotor in (first, second)]
    for one, step in zip(data, (mujoco_rotor.step, lagrangian_rotor.step), strict=True):
        one.torque_q[:] = 0.02, -0.05, 0.03
        for _ in range(400):
            step(one)
    # Rounding over 400 steps of the same method, on rates of some rad/s.
    np.testing.assert_allclose(data[1].q, data[0].q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(data[1].qdot, data[0].qdot, rtol=0, atol=1e-11)


@pytest.mark.parametrize("payload_kg", [0.0, 0.05])
def test_engines_agree_step_by_step(actuator, payload_kg):
    errors = mass_errors(MassSection(**EVERYTHING), 3)
    engine = MujocoRotor([true_model(SHIPPED, 0.2, payload_kg, 9.81, errors)], STEP_s, "RK4")
    equations_of_motion = LagrangianRotor(JointChain.filled(fill_chain, engine.model), STEP_s)
    assert_same_steps(engine, equations_of_motion, ([0.4, -0.3, 0.2], [1.0, 2.0, -3.0]))


def test_friction_gains_no_energy_on_a_general_joint():
    chain = chain_of(MassSection(**EVERYTHING))
    generator = np.random.default_rng(2)
    for coulomb in (1e-3, 1.0, 1e3):
        stage = friction(np.full(3, coulomb), np.full(3, 1e-3), 0.01, STEP_s)
        for _ in range(100):
            q, qdot, torque = generator.uniform(-1.3, 1.3, 3), generator.normal(size=3), np.zeros(3)
            M, before = full(equations(chain, tuple(q), (0.0,) * 3)[0]), qdot.copy()
            slow_down(stage, chain, q, qdot, torque)
            # Rounding relative to the energy before.
            assert qdot @ M @ qdot <= before @ M @ before * (1 + 1e-12)
            assert before @ M @ qdot >= -1e-12 * (before @ M @ before)
            # The mean torque over the step is the change of momentum.
            size = 1e-12 * np.abs(M @ before).max() / STEP_s
            np.testing.assert_allclose(torque * STEP_s, M @ (qdot - before), rtol=0, atol=size * STEP_s)


def test_static_friction_gains_no_energy_on_a_general_joint():
    chain = chain_of(MassSection(**EVERYTHING), gravity_m_s2=0.0)
    section = bearing.StictionSection(on=True)
    fields = section, (5e-3,) * 3, CableSection(), np.full(3, 2e-3), STEP_s
    stage = bearing.BristleFriction.filled(bearing.fill_bristles, *fields)[0]
    q, torque = np.array([0.3, -0.4, 0.5]), np.zeros(3)
    M = full(equations(chain, tuple(q), (0.0,) * 3)[0])
    qdot = np.array([0.2, -0.1, 0.15])

    def energy():
        springs = 0.5 * np.sum(stage.stiffness_Nm_rad * stage.deflection_rad**2)
        return 0.5 * qdot @ M @ qdot + springs

    start = last = energy()
    for _ in range(400):  # the inertia matrix held, as in the proof of `apply_bristles`
        start_q, start_qdot = q.copy(), qdot.copy()
        middle = np.array([0.3, -0.4, 0.5])
        torque[:] = 0.0
        bearing.begin_bristles(stage, middle, q, qdot, torque)
        qdot += STEP_s * np.linalg.solve(M, torque)
        q += 0.5 * STEP_s * (qdot + start_qdot)
        bearing.apply_bristles(stage, chain, middle, start_qdot, start_qdot, q, qdot)
        assert energy() <= last + 1e-12 * start
        last = energy()
        assert np.abs(q - start_q).max() < 1e-3
    assert last < 0.01 * start


def test_a_ring_needs_a_body(tmp_path):
    text, gamma = edited_text(), '<joint name="gamma"'
    start, stop = (text.index(f'<body name="{name}">') for name in ("inner_ring", "rotor"))
    merged = text[:start] + text[stop:].replace("</body>", "", 1)
    (path := tmp_path / "merged.xml").write_text(merged.replace(gamma, models.BETA + gamma), encoding="utf-8")
    assert mujoco.MjModel.from_xml_path(str(path)).nv == 3
    ring = {"plant.mass.ring_inertia_kg_m2": [[0.0] * 3, [1e-4] * 3], "plant.mjcf": str(path)}
    with pytest.raises(InputError, match="received one without a ring at hinge beta"):
        Session(scenarios.load("hold", ring))


def test_a_payload_off_the_axis_is_computed_by_the_equations_of_motion(tmp_path):
    aside = ('<body name="payload" pos="0 0 0.10">', '<body name="payload" pos="0.01 0.02 0.10">')
    path = edited(tmp_path, aside)
    changes = {"plant.mjcf": str(path), "plant.payload_kg": 0.05}
    engines = (scenarios.load("hold", changes | {"plant.engine": name}) for name in ("mujoco", "lagrangian"))
    configs = [initial_config(scenario, None, None) for scenario in engines]
    rotors = [assembly.rotor_of(config.scenario, config.files) for config in configs]
    assert_same_steps(*rotors, ([0.4, -0.3, 0.2], [1.0, 2.0, -3.0]))


def test_a_linear_model_needs_an_ideal_joint():
    with pytest.raises(InputError, match=r"expected an ideal joint, received plant\.mass"):
        linearise(scenarios.load("hold", {"plant.mass.centre_m": [1e-3, 0.0, 0.0]}))
    linearise(scenarios.load("hold", {"plant.mass.centre_m": [1e-3, 0.0, 0.0]}), nominal=True)
