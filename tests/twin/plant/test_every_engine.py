"""What every engine of the registry owes, whichever it is."""

import pickle

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.plant.plant_tick import ENGINES, step_rotor
from spheretwin.plant.rotor import RotorSettings
from spheretwin.session import Session


def hold(name):
    return scenarios.load("hold", {"plant.engine": name, "duration": 0.02, "disturbance.load": 0.5})


@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_moves_the_rotor_and_goes_on_from_a_snapshot_bit_for_bit(name):
    changes = {"plant.engine": name, "duration": 0.02, "disturbance.load": 0.5}
    sessions = [Session(scenarios.load("hold", changes)) for _ in range(2)]
    start = sessions[0].advance(10)
    before = pickle.loads(pickle.dumps(sessions[0].snapshot()))
    rest = sessions[0].advance(10)
    assert np.isfinite(rest.values).all()
    assert (rest["q_rad"][-1] != start["q_rad"][0]).all()
    for session in sessions:
        session.restore(before)
        assert session.advance(10).values.tobytes() == rest.values.tobytes()


@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_s_state_is_all_that_its_steps_depend_on(name, actuator):
    row = ENGINES[name]
    assert row.name == name
    settings = RotorSettings(mjcf.read(actuators.MJCF_PATH), actuator, 5e-4, "RK4", 0.1, 0.0, None)
    rotor = row.set_up(settings)
    data = rotor.start(np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, -3.0]))
    assert isinstance(data, row.data)

    def after_steps():
        data.torque_q[:] = [0.01, -0.02, 0.03]
        for _ in range(5):
            step_rotor(data)
        return np.concatenate([data.q, data.qdot]).tobytes()

    before = rotor.state().copy()
    moved = after_steps()
    assert after_steps() != moved
    rotor.restore(before)
    assert after_steps() == moved
