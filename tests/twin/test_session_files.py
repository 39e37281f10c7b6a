"""What a session keeps: its files as they were, its user's laws, and its own idea of where it ends."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import Change
from spheretwin.session import Session
from spheretwin.simulation import follow

GAMMA = '<joint name="gamma" axis="0 0 1"/>'


def proportional(t, reference, measurement, parameters, state, torque):
    state[0] += 1
    for axis in range(3):
        torque[axis] = (
            parameters[0] * (reference[0, axis] - measurement[0, axis]) - 0.05 * measurement[1, axis]
        )


def own(name, calls=0.0):
    return Law(name, proportional, [0.5], [calls])


def test_a_curve_that_is_edited_meanwhile_changes_nothing_of_a_session(tmp_path):
    (curve := tmp_path / "mine.csv").write_bytes(actuators.TORQUE_CURVE_PATH.read_bytes())
    scenario = scenarios.load("hold", {"plant.torque_curve": str(curve)})
    left_alone, edited = Session(scenario), Session(scenario)
    for session in (left_alone, edited):
        session.advance(100)
    snapshot = edited.snapshot()
    halved = [line if line[0] in "#p" else f"{line.split(',')[0]},{float(line.split(',')[1]) / 2}"
              for line in curve.read_text().splitlines()]  # fmt: skip
    curve.write_text("\n".join(halved))
    for session in (left_alone, edited):
        session.set("controller.reaching_gain", 30.0)
        session.set("plant.modelling_error", 0.1)
    assert edited.advance(200).values.tobytes() == left_alone.advance(200).values.tobytes()
    edited.restore(snapshot)  # of the same curve, as this session has it
    with pytest.raises(InputError, match="same model and torque curves"):
        Session(scenario).restore(snapshot)


def test_a_session_remembers_the_laws_that_it_has_been_given():
    session = Session(scenarios.load("hold"), own("mine"))
    session.advance(50)
    snapshot = session.snapshot()
    expected = session.advance(50).values
    session.set("controller.law", "pd")
    session.set("controller.law", own("another"))
    session.advance(10)
    session.restore(snapshot)
    assert session.law.name == "mine"
    assert session.advance(50).values.tobytes() == expected.tobytes()


@pytest.mark.parametrize("name", ["mine", "afsm"])
def test_another_law_of_the_same_name_begins_with_its_own_memory(name):
    session = Session(scenarios.load("hold"), own(name))
    session.advance(8)
    session.set("controller.law", own(name, calls=100.0))
    session.advance(1)
    assert session.snapshot().runtime.parts["the law's memory"][0] == 101.0


@pytest.mark.parametrize("chunk", [1, 7, 400])
def test_the_length_of_a_chunk_does_not_decide_where_an_engine_s_warning_ends_a_run(tmp_path, chunk):
    """A hinge so stiff that the engine counts a bad acceleration within the first tick."""
    meshes = f'meshdir="{actuators.FOLDER / "assets"}"'
    stiff = GAMMA.replace("/>", ' stiffness="1e9" springref="90"/>')
    text = actuators.MJCF_PATH.read_text().replace('meshdir="assets"', meshes).replace(GAMMA, stiff)
    (path := tmp_path / "stiff.xml").write_text(text)
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


@pytest.mark.parametrize("ticks", [10**14, 10**30])
def test_more_ticks_than_memory_holds_are_refused(ticks):
    with pytest.raises(InputError, match=r"memory|number of ticks"):
        Session(scenarios.load("hold")).advance(ticks)


@pytest.mark.parametrize("log", [[[1.0]], None, np.zeros((2, 3)), np.zeros(4)])
def test_rows_that_are_no_telemetry_are_refused(log):
    with pytest.raises(InputError, match="contiguous, writeable rows"):
        Session(scenarios.load("hold")).advance_into(log)
