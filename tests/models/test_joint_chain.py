"""The general joint against MuJoCo, its energy, and the closed forms of the ideal joint."""

import mujoco
import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models import lagrangian, mjcf
from spheretwin.models.joint_chain import (
    JointChain,
    acceleration_at,
    equations,
    fill_chain,
    fill_ideal,
    hinge_torque,
    ideal_pose,
    inertia_at,
)
from spheretwin.models.kinematics import rate_jacobian, rotation
from spheretwin.plant import lagrangian_rotor
from spheretwin.plant.lagrangian_rotor import LagrangianRotor
from tests.twin.plant.motions import order

# Rounding of some hundred operations on terms that partly cancel; measured: 2e-14.
ROUNDING = 1e-12


def text(numbers):
    return " ".join(f"{number:.17g}" for number in np.ravel(numbers))


def random_machine(seed):
    """MJCF of a chain of three hinges and a body on its end, with everything anywhere."""
    generator = np.random.default_rng(seed)

    def inertial():
        """Mass, centre of mass and a full tensor about it that a body can have."""
        root = generator.normal(size=(3, 3))
        second = root @ root.T
        tensor = 1e-3 * (np.trace(second) * np.eye(3) - second)
        mass, centre = generator.uniform(0.2, 2), 0.1 * generator.normal(size=3)
        full = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        return f'<inertial pos="{text(centre)}" mass="{mass}" fullinertia="{text(full)}"/>'

    bodies = ""
    for name in ("alpha", "beta", "gamma"):
        place = f'pos="{text(0.1 * generator.normal(size=3))}" quat="{text(generator.normal(size=4))}"'
        joint = f'axis="{text(generator.normal(size=3))}" pos="{text(0.1 * generator.normal(size=3))}"'
        bodies += f'<body {place} name="{name}"><joint name="{name}" {joint}/>{inertial()}'
    bodies += f'<body pos="0.1 0 0.2">{inertial()}</body>' + "</body>" * 3
    option = f'<option gravity="{text(10 * generator.normal(size=3))}"/>'
    return mujoco.MjModel.from_xml_string(f"<mujoco>{option}<worldbody>{bodies}</worldbody></mujoco>")


def random_states(count, seed=0):
    generator = np.random.default_rng(seed)
    for _ in range(count):
        yield generator.uniform(-3, 3, 3), generator.uniform(-20, 20, 3)


def full(M):
    return np.array([
        [M.alpha, M.alpha_beta, M.alpha_gamma],
        [M.alpha_beta, M.beta, M.beta_gamma],
        [M.alpha_gamma, M.beta_gamma, M.gamma],
    ])  # fmt: skip


def chain_of(model):
    return JointChain.filled(fill_chain, model)[0]


def of(chain, q, qdot):
    M, bias = equations(chain, tuple(q), tuple(qdot))
    return full(M), np.array(bias)


@pytest.mark.parametrize("seed", range(5))
def test_inertia_matrix_and_bias_are_mujoco_s(seed):
    model = random_machine(seed)
    data, chain, M = mujoco.MjData(model), chain_of(model), np.empty((3, 3))
    for q, qdot in random_states(20, seed):
        data.qpos[:], data.qvel[:] = q, qdot
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, M)
        ours, bias = of(chain, q, qdot)
        np.testing.assert_allclose(ours, M, rtol=0, atol=ROUNDING * np.abs(M).max())
        np.testing.assert_allclose(bias, data.qfrc_bias, rtol=0, atol=ROUNDING * np.abs(bias).max())


@pytest.mark.parametrize("seed", range(5))
def test_orientation_angular_velocity_and_power_are_mujoco_s(seed):
    model = random_machine(seed)
    data, chain, angles, rates = mujoco.MjData(model), chain_of(model), np.empty(3), np.empty(3)
    rotor, torque_S, torque_q = data.body("gamma"), np.array([0.3, -0.2, 0.5]), np.empty(3)
    mujoco.mj_forward(model, data)
    upright = rotor.xmat.reshape(3, 3).copy()
    for q, qdot in random_states(20, seed):
        data.qpos[:], data.qvel[:] = q, qdot
        mujoco.mj_forward(model, data)
        ideal_pose(chain, q, qdot, angles, rates)
        np.testing.assert_allclose(rotation(angles) @ upright, rotor.xmat.reshape(3, 3), rtol=0, atol=1e-13)
        # Rates near the singularity are large; their product with the Jacobian cancels.
        size = 1e-13 * max(1.0, np.abs(rates).max())
        np.testing.assert_allclose(rate_jacobian(angles) @ rates, rotor.cvel[:3], rtol=0, atol=size)
        hinge_torque(chain, q, torque_S, torque_q)
        assert torque_q @ qdot == pytest.approx(torque_S @ rotor.cvel[:3], abs=1e-13)


SHIPPED = mjcf.read(actuators.MJCF_PATH).bare


def test_ideal_joint_has_the_closed_forms(actuator):
    chain, payload_kg, height = chain_of(SHIPPED), 0.05, 0.1
    spec = mujoco.MjSpec.from_file(str(actuators.MJCF_PATH))
    spec.body("payload").mass, spec.body("payload").explicitinertial = payload_kg, True
    loaded = chain_of(spec.compile())
    heavier = actuator.inertia + payload_kg * height**2 * np.array([1, 1, 0])
    for machine, inertia, moment in ((chain, actuator.inertia, 0.0), (loaded, heavier, payload_kg * 0.981)):
        assert not machine.is_tilted
        for q, qdot in random_states(50):
            M, bias = of(machine, q, qdot)
            expected = lagrangian.inertia_matrix(q, inertia)
            # Rounding 1e-16, and the rings of the engine's model, of 1.1e-15 kg·m² each.
            np.testing.assert_allclose(M, expected, rtol=0, atol=1e-14 * np.abs(expected).max() + 3e-15)
            expected = lagrangian.coriolis_matrix(q, qdot, inertia) @ qdot
            expected += lagrangian.gravity_torque(q, moment)
            # The rings are isotropic and add nothing: rounding of the terms, 2e-3 kg·m² times (20 rad/s)².
            np.testing.assert_allclose(bias, expected, rtol=0, atol=1e-14)


def test_energy_of_the_free_chain_is_kept_to_the_order_of_the_step(actuator):
    machine = random_machine(3)
    joint, data = JointChain.filled(fill_chain, machine), mujoco.MjData(machine)
    machine.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    q0, rates0, steps = np.array([0.3, -0.4, 0.2]), np.array([1.0, -2.0, 1.5]), np.array([4e-3, 2e-3, 1e-3])

    def energy(q, qdot):
        data.qpos[:], data.qvel[:] = q, qdot
        mujoco.mj_forward(machine, data)
        return data.energy.sum()

    drifts = []
    for step_s in steps:
        plant = LagrangianRotor(joint, step_s).start(q0, rates0)
        for _ in range(round(0.8 / step_s)):
            lagrangian_rotor.step(plant)
        drifts.append(abs(energy(plant.q, plant.qdot) - energy(q0, rates0)))
    # Order four of the state; the energy of a Runge-Kutta step can be one better, never worse.
    assert 3.7 < order(steps, drifts) < 5.3
    assert drifts[-1] < 1e-6 * abs(energy(q0, rates0))


def test_full_inertia_matrix_is_solved_as_by_a_library():
    generator = np.random.default_rng(3)
    for seed in range(5):
        chain = chain_of(random_machine(seed))
        for q, torque in random_states(20, seed):
            M = inertia_at(chain, (0.0,) * 3, tuple(q))
            added = generator.uniform(0, 1e-2, 3) * (1 + 1j)
            M = M._replace(**dict(zip(("alpha", "beta", "gamma"), full(M).diagonal() + added, strict=True)))
            expected = np.linalg.solve(full(M), torque)
            # Rounding, with a condition up to some hundreds.
            size = 1e-12 * np.abs(expected).max()
            solution = lagrangian.solve_inertia(M, tuple(torque), True)
            np.testing.assert_allclose(solution, expected, rtol=0, atol=size)


def test_acceleration_is_that_of_the_joint_that_is_given(actuator):
    q, qdot, torque = np.array([0.2, 0.3, 0.1]), np.array([1.0, 2.0, 3.0]), np.array([0.1, -0.2, 0.3])
    ideal, motion = (tuple(actuator.inertia), 0.05), (tuple(q), tuple(qdot), tuple(torque))
    closed = lagrangian.acceleration(q, qdot, torque, actuator.inertia, 0.05)
    joint = JointChain.filled(fill_ideal, *ideal)[0]
    np.testing.assert_array_equal(acceleration_at(joint, *ideal, *motion), closed)
    chain = chain_of(random_machine(1))
    M, bias = of(chain, q, qdot)
    # Rounding, with a condition up to some hundreds.
    general = M @ acceleration_at(chain, *ideal, *motion)
    np.testing.assert_allclose(general, torque - bias, rtol=0, atol=1e-12)


def test_a_tilted_hinge_is_not_ideal():
    model = mujoco.MjModel.from_xml_path(str(actuators.MJCF_PATH))
    model.jnt_axis[1] = np.array([0.02, 1, -0.02]) / np.sqrt(1 + 2 * 0.02**2)
    assert chain_of(model).is_tilted
