"""Laws from a file of their user's: a class with parameters, a Law, a function; compiled and plain."""

import os

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.scenario import reading
from spheretwin.session import Session
from spheretwin.simulation import simulate

FILE = '''
"""Laws of a user's."""

import numba
import numpy as np
from pydantic import Field

from spheretwin.control.law import Law
from spheretwin.control.law_components.parameters import LawParameters, PositiveEach, each


@numba.njit
def fast(t, reference, measurement, parameters, state, torque):
    for i in range(3):
        error, error_rate = measurement[0, i] - reference[0, i], measurement[1, i] - reference[1, i]
        torque[i] = -parameters[0] * error - parameters[1] * error_rate


class Feedback(LawParameters):
    """Feedback of angle and rate, alike for all hinges."""

    stiffness: PositiveEach = Field(each(0.5), description="of the error, N·m")
    damping: PositiveEach = Field(each(0.03), description="of its rate, N·m·s")

    def build(self, known):
        return Law("feedback", fast, [self.stiffness[0], self.damping[0]], [])


def plain(t, reference, measurement, parameters, state, torque):
    torque[:] = -0.5 * (measurement[0] - reference[0]) - 0.03 * (measurement[1] - reference[1])


ready = Law("ready", fast, [0.5, 0.03], [])
number = 3
'''


@pytest.fixture
def file(tmp_path):
    (path := tmp_path / "mine.py").write_text(FILE)
    return path


def load(reference, *tokens, name="hold"):
    return scenarios.load(name, reading.overrides(["--controller.law", str(reference), *tokens]))


def test_a_class_has_its_parameters_as_fields(file):
    scenario = load(f"{file}:Feedback", "--controller.stiffness", "400", "--controller.damping", "40")
    assert scenario.controller.stiffness == (400.0, 400.0, 400.0)
    rows = {flag: (value, text) for flag, value, text in reading.field_descriptions(scenario)}
    assert rows["--controller.stiffness"] == ("400 400 400", "of the error, N·m")
    assert rows["--controller.law"][0] == f"{file}:Feedback"


@pytest.mark.parametrize("name", ["ready", "fast", "plain", "Feedback"])
def test_every_form_runs_records_and_replays(file, name, tmp_path, capsys):
    numbers = ["--controller.parameters", "0.5", "0.03"] if name == "fast" else []
    law = ["--controller.law", f"{file}:{name}", *numbers]
    first, again = tmp_path / "first.parquet", tmp_path / "again.parquet"
    arguments = ["simulate", "hold", "--duration", "0.2", *law, "--telemetry", str(first)]
    assert cli.main(arguments) == 0
    assert cli.main(["simulate", "--replay", str(first), "--telemetry", str(again)]) == 0
    assert first.read_bytes() == again.read_bytes()
    assert f"{file}:{name}" in read_parquet(first)[1]["scenario"]
    assert str(file) in read_parquet(first)[1]["files"]
    assert capsys.readouterr().err == ""
    file.write_text(FILE + "\n# edited since\n")
    assert cli.main(["simulate", "--replay", str(first)]) == 2
    assert "mine.py as it was at the start of the run" in capsys.readouterr().err


def test_all_forms_of_one_law_agree(file):
    runs = [
        simulate(load(f"{file}:{name}", "--duration", "0.2", *numbers)).telemetry["q_rad"]
        for name, numbers in [
            ("ready", []), ("fast", ["--controller.parameters", "0.5", "0.03"]), ("plain", []),
        ]
    ]  # fmt: skip
    np.testing.assert_array_equal(runs[0], runs[1])
    # Compiled code may fuse a product and a sum, which rounds once instead of twice.
    np.testing.assert_allclose(runs[2], runs[0], rtol=0, atol=1e-12)


def test_in_toml_its_path_is_taken_from_where_it_is_written(file, tmp_path, monkeypatch):
    text = 'duration = 0.05\n[trajectory]\nshape = "hold"\n[controller]\nlaw = "mine.py:Feedback"\n'
    (tmp_path / "s.toml").write_text(text + "damping = [0.03, 0.04, 0.05]\n")
    monkeypatch.chdir(tmp_path.parent)
    scenario = scenarios.load(str(tmp_path / "s.toml"))
    assert scenario.controller.damping == (0.03, 0.04, 0.05)
    assert simulate(scenario).status == "completed"


def test_a_session_exchanges_it_and_knows_it_in_another_process(file):
    import pickle

    with Session(load(f"{file}:Feedback")) as session:
        session.advance(50)
        session.set("controller.stiffness", 0.6)
        session.advance(50)
        snapshot = pickle.loads(pickle.dumps(session.snapshot()))
        ahead = session.advance(50).values.tobytes()
        session.set("controller.law", "pd")
        session.advance(10)
        session.set("controller.law", f"{file}:ready")
        assert [change.name for change in session.journal][-1] == "controller.law"
        session.restore(snapshot)
        assert session.advance(50).values.tobytes() == ahead


def test_a_session_keeps_the_law_that_it_read(file):
    with Session(load(f"{file}:ready")) as unchanged, Session(load(f"{file}:ready")) as session:
        file.write_text(FILE.replace("parameters[0] * error", "3 * parameters[0] * error"))
        session.set("disturbance.load", 0.5)
        unchanged.set("disturbance.load", 0.5)
        assert session.advance(50).values.tobytes() == unchanged.advance(50).values.tobytes()
    edited = simulate(load(f"{file}:ready", "--duration", "0.05"))
    file.write_text(FILE)
    assert (
        edited.telemetry.values.tobytes()
        != simulate(load(f"{file}:ready")).telemetry.rows(0, 50).values.tobytes()
    )


def test_a_signal_of_an_odd_name_is_recorded_quietly(tmp_path, capfd):
    def step(t, reference, measurement, parameters, state, torque):
        torque[:] = 0.0

    law = Law("odd", step, [], np.zeros(3), (Signal("a b", "1", 3, "odd", ANGLES),))
    path = simulate(scenarios.load("hold", {"duration": 0.01}), law=law).save(tmp_path / "odd.rrd")
    assert capfd.readouterr().err == ""
    assert os.path.getsize(path) > 0
