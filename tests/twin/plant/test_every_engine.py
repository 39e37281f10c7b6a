"""Every engine of the registry: its state; tests of sessions have its motion and its snapshots."""

import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.plant.plant_tick import ENGINES
from spheretwin.plant.rotor import RotorSettings

START = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, -3.0])


def rotor_of(row, actuator):
    return row.set_up(RotorSettings(mjcf.read(actuators.MJCF_PATH), actuator, 5e-4, "RK4", 0.1, 0.0, None))


@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_s_state_is_all_that_its_steps_depend_on(name, actuator):
    row = ENGINES[name]
    assert row.name == name
    rotor = rotor_of(row, actuator)
    data = rotor.start(*START)
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


@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_steps_from_the_pose_and_the_rates_of_its_record(name, actuator):
    row = ENGINES[name]
    one, other = (rotor_of(row, actuator) for _ in range(2))
    one.start(*START)
    other.start(np.zeros(3), np.ones(3))
    other.rows["q"], other.rows["qdot"] = START
    for rotor in (one, other):
        row.step(rotor.rows[0])
    np.testing.assert_array_equal(one.rows["q"], other.rows["q"])
    np.testing.assert_array_equal(one.rows["qdot"], other.rows["qdot"])
    assert np.all(one.rows["q"][0] != START[0])
    np.testing.assert_array_equal(one.state(), other.state())
