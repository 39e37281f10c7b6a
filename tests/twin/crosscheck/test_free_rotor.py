"""A rotor without torque in MuJoCo: energy and momentum stay, and the attitude is Euler's exact solution."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spheretwin.crosscheck.equations import ideal_file, ring_share
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.kinematics import rotation, rotor_rate_jacobian
from spheretwin.plant.mass_properties import true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor
from tests.models.model_files import edited
from tests.twin.crosscheck.commands import GENERAL, VENTUSFF

SAMPLE_s, STEP_s = 0.02, 5e-4  # the default physics step
START_rad = np.array([0.1, -0.2, 0.0])
NODDING = np.array([0.08, 0.05, 1.0])  # rates of α and β as shares of the spin


class Flight:
    """A rotor in flight, a row a sample."""

    def __init__(self, path, inertia, spin, duration_s, integrator="RK4"):
        rotor = MujocoRotor([true_model(mjcf.read(path))], STEP_s, integrator)
        rotor.model.body("rotor").inertia = inertia
        mujoco.mj_setConst(rotor.model, rotor.data)
        rotor.start(START_rad, spin * NODDING)
        q, qdot = rotor.data.qpos, rotor.data.qvel
        self.t_s, self.inertia = SAMPLE_s * np.arange(round(duration_s / SAMPLE_s) + 1), inertia
        self.R, self.w = np.empty((len(self.t_s), 3, 3)), np.empty((len(self.t_s), 3))
        for i in range(len(self.t_s)):
            self.R[i], self.w[i] = rotation(q), rotor_rate_jacobian(q) @ qdot
            mujoco.mj_step(rotor.model, rotor.data, nstep=round(SAMPLE_s / STEP_s))
        self.momentum_S = np.einsum("nij,nj->ni", self.R, inertia * self.w)

    def energy_drift(self):
        energy = np.sum(self.inertia * self.w**2, axis=1)
        return np.abs(energy / energy[0] - 1).max()

    def momentum_drift(self):
        H = self.momentum_S
        return (np.linalg.norm(H - H[0], axis=1) / np.linalg.norm(H[0])).max()

    def attitude_error(self, inertia=None):
        """Angle to the exact attitude with J1 = J2 (Landau and Lifshitz, Mechanics, section 33).

        The third axis turns about the fixed angular momentum H at H/J1, and the rotor turns about its third
        axis at (1 - J3/J1) w3 in addition.
        """
        J1, _, J3 = self.inertia if inertia is None else inertia
        precession = self.t_s[:, None] * self.momentum_S[0] / J1
        own_spin = self.t_s[:, None] * (1 - J3 / J1) * self.w[0, 2] * np.array([0, 0, 1])
        exact = Rotation.from_rotvec(precession) * Rotation.from_matrix(self.R[0])
        exact *= Rotation.from_rotvec(own_spin)
        return (exact.inv() * Rotation.from_matrix(self.R)).magnitude().max()


def bounds(path, actuator, spin, duration_s):
    """Bounds of energy, momentum and attitude: truncation of a fourth-order step, and share of the rings.

    Of the energy and the momentum (ωh)⁴ of the share that nods, with the coefficient, 1/120 or less, as the
    margin; of the attitude (ωh)⁴/120 of the angle turned, with the faster of spin and precession as ω.
    """
    w = rotor_rate_jacobian(START_rad) @ (spin * NODDING)
    nods, rings = np.hypot(w[0], w[1]) / np.linalg.norm(w), ring_share(path, actuator)
    truncation = (spin * STEP_s) ** 4
    fastest = spin * max(1.0, float(actuator.inertia[2] / actuator.inertia[0]))
    attitude = fastest * duration_s * ((fastest * STEP_s) ** 4 / 120 + rings)
    return nods**2 * truncation + rings, nods * truncation + rings, attitude


def errors(path, actuator, spin, duration_s, integrator="RK4"):
    free = Flight(path, actuator.inertia, spin, duration_s, integrator)
    axisymmetric = Flight(path, actuator.inertia[[0, 0, 2]], spin, duration_s, integrator)
    return free.energy_drift(), free.momentum_drift(), axisymmetric.attitude_error()


def exceeded(path, spin, duration_s, integrator="RK4"):
    actuator = actuators.load(path)
    path = ideal_file(path, actuator)
    pairs = zip(
        errors(path, actuator, spin, duration_s, integrator),
        bounds(path, actuator, spin, duration_s),
        strict=True,
    )
    return [error > bound for error, bound in pairs]


@pytest.mark.parametrize(
    ("spin", "duration_s"),
    [(30.0, 6.0), *(pytest.param(s, 60.0, marks=pytest.mark.release("2 s")) for s in (2 * np.pi, 30.0))],
)
def test_a_free_rotor_keeps_what_it_has_and_turns_as_euler_found(spin, duration_s):
    assert exceeded(actuators.MJCF_PATH, spin, duration_s) == [False] * 3


@pytest.mark.release("2 s each; the shipped model takes the same functions")
@pytest.mark.parametrize("kind", [*GENERAL, "ventusff"])
def test_free_rotors_of_other_machines_keep_their_bounds(tmp_path, kind):
    path = VENTUSFF if kind == "ventusff" else edited(tmp_path, *GENERAL[kind])
    assert exceeded(path, 30.0, 60.0) == [False] * 3


def test_another_integrator_exceeds_every_bound():
    assert exceeded(actuators.MJCF_PATH, 30.0, 2.0, "implicitfast") == [True] * 3


def test_a_rotor_that_is_not_axisymmetric_does_not_turn_as_euler_found(actuator):
    inertia, path = actuator.inertia[[0, 0, 2]], actuators.MJCF_PATH
    nearly = Flight(path, inertia * [1, 1 + 1e-7, 1], 2 * np.pi, 2.0)
    assert nearly.attitude_error(inertia) > bounds(path, actuator, 2 * np.pi, 2.0)[2]
