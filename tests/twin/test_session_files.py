"""Sessions and what changes around them: edited files, laws of the same name, the end of a run."""

import dataclasses

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import Change
from spheretwin.session import Session
from spheretwin.simulation import follow
from tests.models.model_files import edited
from tests.twin.session_cases import plain_law, write_curve

GAMMA = '<joint name="gamma" axis="0 0 1"/>'


@pytest.mark.parametrize("chunk", [1, 7, 400])
def test_the_length_of_a_chunk_does_not_decide_where_an_engine_s_warning_ends_a_run(tmp_path, chunk):
    """A hinge so stiff that the engine counts a bad acceleration within the first tick."""
    path = edited(tmp_path, (GAMMA, GAMMA.replace("/>", ' stiffness="1e9" springref="90"/>')))
    changes = {"plant.mjcf": str(path), "plant.step_s": 1e-7, "controller.period_s": 1e-7}
    session = Session(scenarios.load("hold", changes))
    rows = 0
    while session.status == "running" and rows < 400:
        rows += len(session.advance(chunk))
    assert (rows, session.status) == (1, "diverged")


def test_a_run_that_was_saved_on_its_way_from_being_lost_can_be_replayed():
    """The disturbance would be infinite at 226 s, had its envelope not been changed."""
    changes = {"disturbance.random_bound_Nm": 1e-3, "disturbance.gamma_envelope": "growing"}
    scenario = scenarios.load("hold", {**changes, "controller.law": "pd", "plant.engine": "lagrangian"})
    journal = (Change(50, "disturbance.gamma_envelope", "decaying"),)
    assert follow(Session(scenario), 230_000, [], journal=journal) == "completed"
    with pytest.raises(InputError, match="finite disturbance"):
        follow(Session(scenario), 230_000, [])


def test_a_curve_that_is_edited_meanwhile_changes_nothing_of_a_session(tmp_path):
    curve, nominal = tmp_path / "mine.csv", tmp_path / "nominal.csv"
    for path in (curve, nominal):
        path.write_bytes(actuators.TORQUE_CURVE_PATH.read_bytes())
    scenario = scenarios.load("hold", {"plant.torque_curve": str(curve)})
    left_alone, edited = Session(scenario), Session(scenario)
    for session in (left_alone, edited):
        session.advance(100)
    left_alone.set("nominal.torque_curve", str(nominal))
    snapshot = edited.snapshot()
    write_curve(curve, edited.actuator.torque_curve, 0.5)
    edited.set("nominal.torque_curve", str(nominal))
    for session in (left_alone, edited):
        session.set("controller.reaching_gain", 30.0)
        session.set("plant.modelling_error", 0.1)
    assert edited.advance(200).values.tobytes() == left_alone.advance(200).values.tobytes()
    edited.restore(snapshot)  # of the same curve, as this session has it
    with pytest.raises(InputError, match="same model and torque curves"):
        Session(scenario).restore(snapshot)


@pytest.mark.parametrize("name", ["mine", "afsm"])
def test_another_law_of_the_same_name_begins_with_its_own_memory(name):
    session = Session(scenarios.load("hold"), plain_law(name))
    session.advance(8)
    session.set("controller.law", dataclasses.replace(plain_law(name), state=np.array([100.0])))
    session.advance(1)
    assert session.snapshot().runtime.law_memory[0] == 101.0
