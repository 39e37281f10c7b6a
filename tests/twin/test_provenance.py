"""What a run says of itself, taken from its scenario."""

import hashlib
from pathlib import Path

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.run_record import versions
from spheretwin.models.telemetry.status import Status
from spheretwin.provenance import facts_of, record_of
from spheretwin.session import Session


def begun(**changes):
    return Session(scenarios.load("tilt", {"duration": 0.02, **changes}))


def test_facts_are_the_resolved_scenario_s():
    session = begun()
    facts = facts_of(session.initial_scenario)
    assert (facts.name, facts.law, facts.duration_s) == ("tilt", session.law.name, 0.02)
    assert facts.description == session.initial_scenario.description
    assert facts.current_limit_A == session.actuator.group.current_limit_A
    assert facts.payload_kg == 0.05
    assert facts.gravity_m_s2 == session.initial_scenario.plant.gravity_m_s2 == 9.81
    assert facts.mjcf == actuators.MJCF_PATH
    assert facts_of(begun(**{"drive.current_limit_A": 4.0}).initial_scenario).current_limit_A == 4.0


def test_a_model_of_the_user_s_is_the_one_that_is_drawn(tmp_path):
    scenario = scenarios.load("tilt", {"plant.mjcf": str(tmp_path / "m.xml"), "drive.current_limit_A": 8.0})
    assert facts_of(scenario).mjcf == Path(tmp_path / "m.xml")


def test_sections_hold_every_field_once():
    session = begun()
    fields = session.initial_scenario.model_dump(mode="json")
    sections = facts_of(session.initial_scenario).sections
    assert sections["run"]["duration"] == 0.02
    assert not {"name", "description"} & set(sections["run"])
    for name, value in fields.items():
        if isinstance(value, dict):
            assert sections[name] == value
        elif name not in ("name", "description"):
            assert sections["run"][name] == value


def test_a_record_tells_what_was_done_and_not_how_it_ended():
    session = begun()
    session.advance(7)
    session.set("disturbance.load", 1.0)
    record = record_of(session)
    assert (record.ticks, record.journal, record.status) == (7, session.journal, None)
    assert record.scenario["duration"] == 0.02
    assert record.versions == versions()
    assert session.status == Status.RUNNING


def test_a_record_has_the_digests_of_files_that_events_name(tmp_path):
    curve = tmp_path / "curve.csv"
    curve.write_bytes(actuators.TORQUE_CURVE_PATH.read_bytes())
    event = {"t_s": 0.01, "set": "nominal.torque_curve", "value": str(curve)}
    with begun(event=[event]) as session:
        assert record_of(session).files == {str(curve): hashlib.sha256(curve.read_bytes()).hexdigest()}
