"""Every engine of the registry: its state; tests of sessions have its motion and its snapshots."""

import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.plant.plant_tick import ENGINES
from spheretwin.plant.rotor import RotorSettings


@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_s_state_is_all_that_its_steps_depend_on(name, actuator):
    row = ENGINES[name]
    assert row.name == name
    settings = RotorSettings(mjcf.read(actuators.MJCF_PATH), actuator, 5e-4, "RK4", 0.1, 0.0, None)
    rotor = row.set_up(settings)
    data = rotor.start(np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, -3.0]))
    assert data.joint.inertia == pytest.approx(1.1 * actuator.inertia)

    def after_steps():
        data.torque_q[:] = [0.01, -0.02, 0.03]
        for _ in range(5):
            row.step(data)
        return np.concatenate([data.q, data.qdot]).tobytes()

    before = rotor.state().copy()
    moved = after_steps()
    assert after_steps() != moved
    rotor.restore(before)
    assert after_steps() == moved
