"""The engine of MuJoCo: inertia and payload of a run, and states that are not finite."""

import mujoco
import numpy as np

from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.lagrangian import inertia_matrix
from spheretwin.plant.mujoco_rotor import MujocoRotor, step


def rotor(modelling_error=0.0, payload_kg=0.0):
    return MujocoRotor(mjcf.read(actuators.MJCF_PATH), 5e-4, "RK4", modelling_error, payload_kg)


def inertia_of(rotor, q):
    rotor.data.qpos[:] = q
    mujoco.mj_forward(rotor.model, rotor.data)
    M = np.empty((3, 3))
    for i, column in enumerate(np.eye(3)):
        mujoco.mj_mulM(rotor.model, rotor.data, M[i], column)
    return M


def test_modelling_error_scales_the_inertia_matrix_and_a_payload_adds_a_point_mass_on_the_shaft(actuator):
    q, mass = np.array([0.3, -0.5, 1.0]), 0.05
    x, y, z = actuator.payload_mount_m
    point = mass * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    for changes, inertia in (
        ({"modelling_error": 0.2}, 1.2 * actuator.inertia),
        ({"payload_kg": mass}, actuator.inertia + point),
    ):
        expected = inertia_matrix(q, inertia)
        np.testing.assert_allclose(inertia_of(rotor(**changes), q), expected, atol=1e-14)


def test_payload_weighs(actuator):
    loaded, mass, alpha = rotor(payload_kg=0.05), 0.05, 0.2
    inertia_of(loaded, np.array([alpha, 0.0, 0.0]))
    # Upright, then tilted by alpha: gravity's moment about x, by hand.
    moment = mass * 9.81 * actuator.payload_mount_m[2] * np.sin(alpha)
    np.testing.assert_allclose(loaded.data.qfrc_bias, [-moment, 0, 0], atol=1e-12)


def test_a_state_that_is_not_finite_is_counted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its own log into the current folder
    broken = rotor()
    engine = broken.start(np.zeros(3), np.zeros(3))
    assert not engine.warnings.any()
    engine.qdot[0] = 1e11
    step(engine)
    assert engine.warnings[mujoco.mjtWarning.mjWARN_BADQVEL] == 1
