"""Functions of the user's on the command line: figures among the others, or one line that says why not."""

import json

import pytest

from spheretwin import cli
from spheretwin.cli import simulate
from spheretwin.models.telemetry.table import read_parquet

FUNCTIONS = """
import numpy as np

def largest(run):
    return np.abs(run.telemetry["error_rad"]).max(axis=0)

def first_half(run):
    return len(run.telemetry) / run.scenario.ticks

def columns(run):
    return [signal.name for signal in run.telemetry.signals]

def failing(run):
    return run.telemetry["eror_rad"]

def leaving(run):
    raise SystemExit(0)

def a_set(run):
    return {1, 2}

def endless(run):
    found = []
    found.append(found)
    return found

def too_long(run):
    return 10**5000

class Unwritable:
    def __repr__(self):
        raise KeyError("nothing to see")

def unwritable(run):
    return Unwritable()

class Sly(dict):
    def items(self):
        raise LookupError("no")

def sly(run):
    return Sly(a=1)

def loud(run):
    print("looking")
    return 1
"""


@pytest.fixture
def file(tmp_path):
    (path := tmp_path / "mine.py").write_text(FUNCTIONS)
    return path


def simulated(capsys, *arguments):
    """Exit code, figures and what stderr says of a short run."""
    code = cli.main(["simulate", *map(str, arguments), "--json"])
    stdout, stderr = capsys.readouterr()
    return code, json.loads(stdout), stderr


HOLD = "hold", "--duration", "0.05"


def test_functions_stand_among_the_figures(file, capsys):
    code, stdout, _ = simulated(
        capsys, *HOLD, "--metric", f"{file}:largest", "--metric", f"{file}:first_half"
    )
    assert code == 0
    assert stdout["largest"] == stdout["max_abs_error_rad"]
    assert stdout["first_half"] == 1.0


def test_people_are_shown_them_too(file, capsys):
    assert cli.main(["simulate", *HOLD, "--metric", f"{file}:first_half"]) == 0
    assert "first_half 1.0" in capsys.readouterr().out


def test_a_function_that_fails_costs_neither_figures_nor_files(file, tmp_path, capsys):
    path = tmp_path / "run.parquet"
    code, stdout, stderr = simulated(
        capsys, *HOLD, "--metric", f"{file}:failing", "--metric", f"{file}:largest", "--telemetry", path
    )
    assert code == 1
    assert stderr == ""
    assert stdout["failing"] is None
    assert stdout["largest"] == stdout["max_abs_error_rad"]
    (line,) = [warning for warning in stdout["warnings"] if warning.startswith("metric failing: ")]
    assert "did you mean error_rad?" in line
    assert len(read_parquet(path)[0]) == 50


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("leaving", "it raised SystemExit: 0"),
        ("a_set", "expected a value in JSON types, received {1, 2}"),
        ("endless", "expected a value in JSON types, received [[...]]"),
        ("too_long", "received a number of too many digits"),
        ("unwritable", "received a value of class Unwritable, which raises KeyError when it is written"),
        ("sly", "received a value of class Sly, which raises LookupError when it is written"),
    ],
)
def test_whatever_a_function_does_the_run_ends_as_it_would(file, name, message, capsys):
    code, figures, stderr = simulated(capsys, *HOLD, "--metric", f"{file}:{name}")
    assert (code, stderr) == (1, "")
    assert figures[name] is None
    assert figures["max_abs_error_rad"]
    (line,) = [warning for warning in figures["warnings"] if warning.startswith(f"metric {name}: ")]
    assert message in line


def test_what_a_function_prints_is_not_among_the_figures(file, capsys):
    file.write_text("print('loaded')\n" + FUNCTIONS)
    code, figures, stderr = simulated(capsys, *HOLD, "--metric", f"{file}:loud")
    assert (code, figures["loud"]) == (0, 1)
    assert stderr == "loaded\nlooking\n"


def test_a_replayed_run_shows_the_columns_that_came_on_its_way(file, tmp_path, capsys):
    from spheretwin import scenario as scenarios
    from spheretwin.models.telemetry.parquet import TelemetryFile
    from spheretwin.provenance import record_of
    from spheretwin.session import Session

    path = tmp_path / "run.parquet"
    session = Session(scenarios.load("hold", {"duration": 0.05, "controller.law": "pd"}))
    file_of_run = TelemetryFile(path, session.signals, record_of(session).metadata())
    file_of_run.write(session.advance(20))
    session.set("controller.law", "afsm")
    file_of_run.write(session.advance(30))
    file_of_run.close(record_of(session).metadata())
    _, stdout, _ = simulated(capsys, "--replay", path, "--metric", f"{file}:columns")
    assert {"q_rad", "sliding_s"} <= set(stdout["columns"])


def test_telemetry_is_kept_for_own_metrics_alone(file, monkeypatch, capsys):
    """Rows of a run of ages do not fit in memory; without a function no memory is taken for rows."""
    assert cli.main(["simulate", "hold", "--duration", "1e9", "--metric", f"{file}:largest"]) == 2
    assert "fit in memory" in capsys.readouterr().err
    monkeypatch.setattr(simulate, "TelemetryBuffer", None)
    assert cli.main(["simulate", *HOLD]) == 0
