"""What a session goes on from when something is changed: laws, beliefs, files, plans and names."""

import os
import pickle
from pathlib import Path

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin import snapshot as snapshots
from spheretwin.control.law import Law
from spheretwin.models.base.errors import InputError
from spheretwin.scenario import reading
from spheretwin.session import Session

LAWS = '''
import numba
import numpy as np
from pydantic import Field

from spheretwin.control.law import Law
from spheretwin.control.law_components.parameters import LawParameters
from spheretwin.models.telemetry.signals import ANGLES, Signal

SEEN = (Signal("seen", "N·m", 3, "third row", ANGLES),)


class Pid(LawParameters):
    """Its step is made anew by every build."""

    integral: float = Field(0.5, description="gain of the integral, N·m/s")
    mode: str = Field("plain", description="a text")

    def build(self, known):
        ki, period = self.integral, known.period_s

        @numba.njit
        def step(t, reference, measurement, parameters, state, torque):
            parameters[0] += 1.0
            for i in range(3):
                error = measurement[0, i] - reference[0, i]
                state[i] += error * period
                torque[i] = -0.5 * error - 0.03 * measurement[1, i] - ki * state[i]

        return Law("pid", step, [0.0], np.zeros(3), (Signal("integral", "rad·s", 3, "of the error", ANGLES),))


class Sized(LawParameters):
    order: int = Field(3, ge=3, description="numbers it remembers")

    def build(self, known):
        return Law("sized", see, [], np.zeros(self.order), SEEN)


@numba.njit
def see(t, reference, measurement, parameters, state, torque):
    for i in range(3):
        state[i] = measurement[2, i] if measurement[2, i] == measurement[2, i] else -7.0
        torque[i] = -0.5 * (measurement[0, i] - reference[0, i]) - 0.03 * measurement[1, i]


asks = Law("asks", see, [], np.zeros(3), SEEN, True)
silent = Law("silent", see, [], np.zeros(3), SEEN)
clash = Law("clash", see, [], np.zeros(3), (Signal("seen", "1", 1, "something else"),))


class Other(LawParameters):
    level: float = Field(1.0, description="a number under a name that others have for a text")

    def build(self, known):
        return silent
'''


@pytest.fixture
def file(tmp_path):
    (path := tmp_path / "laws.py").write_text(LAWS)
    return path


def hold(**changes):
    return scenarios.load("hold", {"duration": 0.2, **changes})


@pytest.mark.parametrize(
    ("name", "value", "calls"),
    [
        ("plant.coulomb_Nm", [0.0, 0.0, 1e-9], 51.0),
        ("disturbance.load", 1.0, 51.0),
        ("allocation", "bounded", 51.0),
        ("controller.integral", 5.0, 1.0),
    ],
)
def test_a_law_whose_step_is_made_by_its_build_keeps_its_memory(file, name, value, calls):
    """It takes its parameters from a change of its own fields alone: otherwise what it made of them stays."""
    with Session(hold(**{"controller.law": f"{file}:Pid"})) as session:
        before = session.advance(50)["integral"][-1]
        session.set(name, value)
        after = session.advance(1)["integral"][0]
        # One more tick of an error of at most 0.3 rad over 1 ms.
        np.testing.assert_allclose(after, before, rtol=0, atol=3.1e-4)
        assert session.snapshot().runtime.law_parameters[0] == calls


def test_a_memory_of_another_size_begins_anew(file):
    with Session(hold(**{"controller.law": f"{file}:Sized"})) as session:
        session.advance(10)
        session.set("controller.order", 5)
        session.advance(10)
        np.testing.assert_array_equal(session.snapshot().runtime.law_memory[3:], 0.0)


def test_who_does_not_ask_is_told_nothing_after_one_who_did(file):
    with Session(hold(**{"controller.law": f"{file}:asks"})) as session:
        assert np.all(session.advance(50)["seen"][-1] != -7.0)
        session.set("controller.law", f"{file}:silent")
        np.testing.assert_array_equal(session.advance(5)["seen"], -7.0)


@pytest.mark.parametrize("delay_s", [5e-4, 1e-3, 2.5e-3])
def test_a_belief_goes_on_under_another_delay(file, delay_s):
    with Session(hold(**{"controller.law": f"{file}:asks"})) as session:
        before = session.advance(100)["seen"][-1]
        session.set("nominal.delay_s", delay_s)
        after = session.advance(1)["seen"][0]
        # From one tick to the next the torque changes by little, as at any other tick.
        np.testing.assert_allclose(after, before, rtol=0.05, atol=2e-3)


def test_one_name_means_one_signal_throughout(file):
    with Session(hold(**{"controller.law": f"{file}:asks"})) as session:
        session.advance(10)
        with pytest.raises(InputError, match="expected the signal seen as it was before"):
            session.set("controller.law", f"{file}:clash")
        assert session.scenario.controller.law == f"{file}:asks"
    planned = [{"t_s": 0.1, "set": "controller.law", "value": f"{file}:clash"}]
    with pytest.raises(InputError, match=r"signal seen .*, as the event at 0\.1 s sets it"):
        Session(hold(**{"controller.law": f"{file}:asks", "event": planned}))


def test_two_laws_of_one_name_are_two_to_a_snapshot():
    def law(torque_Nm):
        def step(t, reference, measurement, parameters, state, torque):
            torque[:] = torque_Nm

        return Law("mine", step, [], [])

    with Session(hold(), law(1e-3)) as session:
        session.advance(3)
        snapshot = session.snapshot()
        session.set("controller.law", law(2e-3))
        second = session.snapshot()
        session.restore(snapshot)
        np.testing.assert_array_equal(session.advance(1)["torque_command_Nm"], 1e-3)
        session.restore(second)
        np.testing.assert_array_equal(session.advance(1)["torque_command_Nm"], 2e-3)


def test_a_snapshot_knows_a_law_of_a_file_by_what_the_file_held(file):
    with Session(hold(**{"controller.law": f"{file}:asks"})) as session:
        session.advance(3)
        taken = pickle.dumps(session.snapshot())
        file.write_text(LAWS.replace("-0.5 *", "-0.6 *"))
        with pytest.raises(InputError, match="as it was when the snapshot was taken"):
            session.restore(pickle.loads(taken))


def test_a_pickled_snapshot_of_another_version_is_refused(monkeypatch):
    with Session(hold()) as session:
        snapshot = session.snapshot()
    message = f"^session: expected a snapshot of version {snapshots.VERSION}, received one of version "
    for version in (snapshots.VERSION + 1, 1):
        with monkeypatch.context() as patch:
            patch.setattr(snapshots, "VERSION", version)
            if version == 1:
                patch.delattr(snapshots.Snapshot, "__reduce__")
            content = pickle.dumps(snapshot)
        with pytest.raises(InputError, match=f"{message}{version}$"):
            pickle.loads(content)


def test_a_trajectory_of_the_user_s_is_not_taken_for_a_shape():
    class hold_:
        def sample(self, t):
            return np.zeros((len(t), 3, 3))

    hold_.__name__ = "hold"
    with Session(hold(), trajectory=hold_()) as session:
        assert session.initial_scenario.trajectory.shape == "hold of the user's"
    named = Law("pd", lambda *_: None, [], [])
    with Session(hold(), named) as session:
        assert session.initial_scenario.controller.law == "pd of the user's"


POSES = "t_s,alpha_rad,beta_rad,gamma_rad\n0,0,0,0\n0.1,0.1,0,0\n"
TORQUES = "t_s,alpha_Nm,beta_Nm,gamma_Nm\n0,0.01,0,0\n1,0.02,0,0\n"
TABLES = (
    'duration = 0.2\n[trajectory]\nshape = "waypoints"\nfile = "poses.csv"\n'
    '[[disturbance.terms]]\nkind = "table"\nfile = "torques.csv"\n'
)


@pytest.fixture
def tables(tmp_path):
    (tmp_path / "poses.csv").write_text(POSES)
    (tmp_path / "torques.csv").write_text(TORQUES)
    (path := tmp_path / "tables.toml").write_text(TABLES)
    return path


def edit(path):
    path.write_text(path.read_text().replace("0.1,0.1", "0.1,0.2").replace("0.02", "0.03"))


@pytest.mark.parametrize("act", [os.remove, edit], ids=["removed", "edited"])
def test_other_changes_leave_tables_as_they_were(tables, act):
    def run(act):
        with Session(scenarios.load(str(tables))) as session:
            session.advance(20)
            for each in ("poses.csv", "torques.csv"):
                act(tables.parent / each)
            session.set("disturbance.load", 0.5)
            for law in ("pd", "afsm"):
                session.set("controller.law", law)
            return session.advance(1000).values.tobytes()

    assert run(Path.exists) == run(act)


def test_a_table_that_is_set_is_read_again(tables):
    with Session(scenarios.load(str(tables))) as session:
        (tables.parent / "torques.csv").write_text(TORQUES.replace("0.01", "0.03"))
        session.set("disturbance.load", 0.0)
        assert session.advance(1)["disturbance_Nm"][0, 0] == 0.01
        session.set("disturbance.terms.0.file", str(tables.parent / "torques.csv"))
        # The second tick of a line from 0.03 to 0.02 N·m in 1 s.
        np.testing.assert_allclose(session.advance(1)["disturbance_Nm"][0, 0], 0.02999, rtol=1e-12)


def test_a_pickled_session_needs_its_law_s_file_and_no_table(file, tables, tmp_path, monkeypatch):
    scenario = scenarios.load(str(tables), {"controller.law": f"{file}:asks"})
    with Session(scenario) as session:
        session.advance(10)
        taken = pickle.dumps((session.snapshot(), session.scenario.controller))
        ahead = session.advance(10).values.tobytes()
        for each in ("poses.csv", "torques.csv"):
            (tables.parent / each).unlink()
        (elsewhere := tmp_path / "elsewhere").mkdir()
        monkeypatch.chdir(elsewhere)
        snapshot, controller = pickle.loads(taken)
        assert controller == scenario.controller
        session.restore(snapshot)
        assert session.advance(10).values.tobytes() == ahead


def test_a_session_under_a_law_of_its_own_beside_one_from_a_file_is_pickled(file):
    own = Law("own", lambda *_: None, [], [])
    with Session(hold(**{"controller.law": f"{file}:asks"}), own) as session:
        assert pickle.loads(pickle.dumps(session.snapshot())).scenario == session.scenario


@pytest.mark.parametrize(("start_s", "warns"), [(0.049, False), (0.0495, True), (0.05, True), (3.0, True)])
def test_a_fault_that_starts_after_the_last_tick_is_warned_of(start_s, warns):
    """The last tick of 0.05 s is at 0.049 s; a fault starts at the first tick from its time on."""
    fault = {"target": "coil.00", "mode": "open", "start_s": start_s}
    with Session(scenarios.load("hold", {"duration": 0.05, "fault": [fault]})) as session:
        message = f"the fault coil.00 open does not occur: it starts at {start_s:g} s, the run ends at 0.05 s"
        assert session.warnings() == [message] * warns


def test_another_member_keeps_what_it_has_of_the_same_kind(file):
    with Session(hold(**{"controller.surface_slope": 60.0})) as session:
        session.set("controller.law", "adaptive_fuzzy")
        assert session.scenario.controller.surface_slope == (60.0, 60.0, 60.0)
        session.set("controller.law", f"{file}:Other")  # whose level is a number
        assert session.scenario.controller.level == 1.0


def test_a_member_of_a_list_is_exchanged_too():
    term = {"kind": "constant", "torque_Nm": [0.01, 0.0, 0.0]}
    with Session(hold(**{"disturbance.terms": [term]})) as session:
        session.set("disturbance.terms.0.kind", "sinusoidal")
        assert session.scenario.disturbance.terms[0].kind == "sinusoidal"


def test_nothing_of_the_caller_s_is_altered(tables, monkeypatch):
    monkeypatch.setenv("HOME", str(tables.parent))
    term = {"kind": "table", "file": "~/torques.csv"}
    with Session(hold()) as session:
        session.set("disturbance.terms", [term])
    assert term["file"] == "~/torques.csv"


def test_a_text_of_a_law_from_a_file_may_look_like_a_number(file):
    tokens = ["--controller.law", f"{file}:Pid", "--controller.mode", "12"]
    assert scenarios.load("hold", reading.overrides(tokens)).controller.mode == "12"
