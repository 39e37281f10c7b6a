"""What a run says of itself, taken from its scenario."""

import hashlib

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.run_record import versions
from spheretwin.records.provenance import facts_of, record_of
from spheretwin.session import Session


def begun(**changes):
    return Session(scenarios.load("tilt", {"duration": 0.02, **changes}))


def test_facts_are_the_resolved_scenario_s(tmp_path):
    facts = facts_of(begun().initial_scenario)
    assert (facts.current_limit_A, facts.payload_kg, facts.gravity_m_s2) == (8.0, 0.05, 9.81)
    assert facts.mjcf == actuators.MJCF_PATH
    own = {"plant.mjcf": str(tmp_path / "m.xml"), "drive.current_limit_A": 4.0}
    facts = facts_of(scenarios.load("tilt", own))
    assert (facts.current_limit_A, facts.mjcf) == (4.0, tmp_path / "m.xml")


def test_a_record_tells_what_was_done_and_not_how_it_ended():
    session = begun()
    session.advance(7)
    session.set("disturbance.load", 1.0)
    record = record_of(session)
    assert (record.ticks, record.journal, record.status) == (7, session.journal, None)
    assert record.versions == versions()


def test_a_record_has_the_digests_of_files_that_events_name(tmp_path):
    curve = tmp_path / "curve.csv"
    curve.write_bytes(actuators.TORQUE_CURVE_PATH.read_bytes())
    event = {"t_s": 0.01, "set": "nominal.torque_curve", "value": str(curve)}
    with begun(event=[event]) as session:
        assert record_of(session).files == {str(curve): hashlib.sha256(curve.read_bytes()).hexdigest()}
