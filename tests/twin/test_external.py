"""Controller or plant outside of the process: its place in the loop, its errors, its end."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.supervision.watchdog import Reason
from spheretwin.loop.external import ExternalController, ExternalPlant, Measurement
from spheretwin.models.base.errors import InputError
from spheretwin.records import replay
from spheretwin.records.provenance import record_of
from spheretwin.session import Session
from spheretwin.simulation import follow

GROUPS = 18


class Controller(ExternalController):
    name = "a test"

    def __init__(self, answer):
        self.answer, self.times, self.measurements = answer, [], []

    def command(self, t_s, measurement):
        self.times.append(t_s)
        self.measurements.append(measurement._replace(angle_rad=measurement.angle_rad.copy()))
        return self.answer(len(self.times) - 1)


class Plant(ExternalPlant):
    name, authority = "a test", 1.0

    def __init__(self, answer):
        self.answer, self.currents = answer, []

    def advance(self, t_s, current_A):
        self.currents.append(current_A.copy())
        return self.answer(len(self.currents) - 1)


def session(external, **changes):
    return Session(scenarios.load("sinusoid", changes), external=external)


def at_rest(_):
    return Measurement(np.zeros(3), np.zeros(3)), Reason.NONE


def constant(_):
    return np.full(GROUPS, 0.5)


def test_the_currents_of_a_controller_are_those_of_manual_currents():
    controller = Controller(constant)
    rows = session(controller).advance(20)
    manual = session(None, **{"manual.currents_A": [0.5] * GROUPS}).advance(20)
    assert rows.values.tobytes() == manual.values.tobytes()
    np.testing.assert_array_equal(controller.times, rows["t_s"])
    # Each command answers the measurement of its own tick.
    np.testing.assert_array_equal([m.angle_rad for m in controller.measurements], rows["q_rad"])


def test_a_plant_receives_the_commands_and_its_measurements_are_the_telemetry():
    poses = np.linspace(0.0, 0.01, 20)[:, None] * [1.0, 2.0, 3.0]
    plant = Plant(lambda k: (Measurement(poses[min(k + 1, 19)], np.zeros(3)), Reason.NONE))
    twin = session(plant)
    rows = twin.advance(20)
    np.testing.assert_array_equal(rows["q_rad"], poses)
    np.testing.assert_array_equal(plant.currents, rows["current_command_A"])
    np.testing.assert_array_equal(rows["current_A"], rows["current_command_A"])
    assert np.any(rows["torque_Nm"])


def test_the_authority_scales_what_is_sent_and_what_is_expected():
    plant = Plant(at_rest)
    plant.authority = 0.25
    # The estimate of the applied torque follows the currents that are sent.
    reduced = session(plant, **{"detector.detect": True})
    full = session(Plant(at_rest), **{"detector.detect": True})
    rows = reduced.advance(3)["current_command_A"]
    np.testing.assert_allclose(rows[0], 0.25 * full.advance(3)["current_command_A"][0], rtol=1e-15)
    expected = reduced._runtime._controller.data.applied_torque.current
    # After three ticks with L/R = 0.69 ms; the bound is that of the last change of the command.
    np.testing.assert_allclose(expected, rows[-1], atol=0.3 * np.abs(np.diff(rows[-2:], axis=0)).max() + 1e-3)


def test_none_ends_the_run_as_interrupted():
    for external in (
        Controller(lambda k: np.zeros(GROUPS) if k < 5 else None),
        Plant(lambda k: at_rest(k) if k < 5 else None),
    ):
        twin = session(external)
        assert follow(twin, 100, []) == "interrupted"
        assert 5 <= twin.tick <= 6


def test_a_reason_removes_the_currents_and_ends_the_run_as_failsafe():
    plant = Plant(lambda k: (at_rest(k)[0], Reason.CURRENT if k >= 5 else Reason.NONE))
    twin = session(plant)
    assert follow(twin, 200, []) == "failsafe"
    assert twin.reason == Reason.CURRENT
    assert np.any(plant.currents[5])
    assert not np.any(plant.currents[6:])
    assert 50 <= len(plant.currents) - 6 <= 52  # the rundown


@pytest.mark.parametrize("error", [ValueError("broken"), KeyboardInterrupt()])
@pytest.mark.parametrize("kind", [Controller, Plant])
def test_an_exception_passes_the_compiled_loop(error, kind):
    def answer(k):
        if k == 3:
            raise error
        return np.zeros(GROUPS) if kind is Controller else at_rest(k)

    with pytest.raises(type(error)) as raised:
        session(kind(answer)).advance(10)
    assert raised.value is error


def test_a_change_during_the_run_keeps_the_connection():
    controller = Controller(constant)
    twin = session(controller)
    twin.advance(5)
    twin.set("disturbance.load", 2.0)
    twin.set("plant.payload_kg", 0.02)
    twin.advance(5)
    assert len(controller.times) == 10


def test_the_journal_names_the_part_and_a_replay_is_refused(tmp_path):
    twin = session(Controller(constant))
    rows = twin.advance(5)
    rows.write_parquet(path := tmp_path / "run.parquet", record_of(twin).metadata())
    with pytest.raises(InputError, match="expected a run of the twin alone, received one with a test"):
        replay.read(path)
