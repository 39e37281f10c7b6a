"""What every engine of the registry owes, whichever it is."""

import pickle

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.telemetry.status import Status
from spheretwin.plant.plant_tick import ENGINES, step_rotor
from spheretwin.plant.rotor import RotorSettings
from spheretwin.session import Session
from spheretwin.simulation import simulate


def hold(name):
    return scenarios.load("hold", {"plant.engine": name, "duration": 0.02, "disturbance.load": 0.5})


@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_moves_the_rotor(name):
    run = simulate(hold(name))
    assert run.status == Status.COMPLETED
    assert np.isfinite(run.telemetry.values).all()
    assert (run.telemetry["q_rad"][-1] != run.telemetry["q_rad"][0]).all()


@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_goes_on_from_a_snapshot_bit_for_bit(name):
    with Session(hold(name)) as session:
        session.advance(10)
        before = pickle.loads(pickle.dumps(session.snapshot()))
        rows = session.advance(10).values.tobytes()
        session.restore(before)
        assert session.advance(10).values.tobytes() == rows
    with Session(hold(name)) as another:
        another.restore(before)
        assert another.advance(10).values.tobytes() == rows


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
