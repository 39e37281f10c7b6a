"""Functions of the user's on the command line: figures among the others, or one line that says why not."""

import pytest

from spheretwin import scenario as scenarios
from spheretwin.cli import simulate
from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.records.provenance import record_of
from spheretwin.session import Session
from tests.twin.cli.calls import call, refusal

FUNCTIONS = {
    "largest": "return abs(run.telemetry['error_rad']).max(axis=0)",
    "columns": "return [signal.name for signal in run.telemetry.signals]",
    "loud": "return print('looking') or 1",
}

WITHOUT_FIGURE = {
    "leaving": ("raise SystemExit(0)", "it raised SystemExit: 0"),
    "a_set": ("return {1, 2}", "expected a value in JSON types, received {1, 2}"),
    "endless": (
        "return (lambda inside: inside.append(inside) or inside)([])",
        "expected a value in JSON types, received [[...]]",
    ),
    "too_long": ("return 10**5000", "received a number of too many digits"),
    "unwritable": (
        "return type('Unwritable', (), {'__repr__': lambda self: {}['nothing to see']})()",
        "received a value of class Unwritable, which raises KeyError when it is written",
    ),
    "sly": (
        "return type('Sly', (dict,), {'items': lambda self: [].pop()})(a=1)",
        "received a value of class Sly, which raises IndexError when it is written",
    ),
    "failing": ("return run.telemetry['eror_rad']", "did you mean error_rad?"),
}


@pytest.fixture
def file(tmp_path):
    functions = FUNCTIONS | {name: statement for name, (statement, _) in WITHOUT_FIGURE.items()}
    texts = [f"def {name}(run):\n    {statement}\n" for name, statement in functions.items()]
    (path := tmp_path / "mine.py").write_text("\n".join(texts))
    return path


def simulated(file, *names, more=("hold", "--duration", "0.05")):
    """Call of a short run with functions of a file."""
    return call(
        "simulate", *more, "--json", *(text for name in names for text in ("--metric", f"{file}:{name}"))
    )


@pytest.mark.parametrize("name", WITHOUT_FIGURE)
def test_whatever_a_function_does_the_run_ends_as_it_would(file, name, tmp_path):
    run = ("hold", "--duration", "0.05", "--telemetry", tmp_path / "run.parquet")
    result = simulated(file, name, "largest", more=run)
    figures = result.json
    assert (result.code, result.err) == (1, "")
    assert figures[name] is None
    assert figures["largest"] == figures["max_abs_error_rad"]
    (line,) = [warning for warning in figures["warnings"] if warning.startswith(f"metric {name}: ")]
    assert WITHOUT_FIGURE[name][1] in line
    assert len(read_parquet(tmp_path / "run.parquet")[0]) == 50


def test_what_a_function_prints_is_not_among_the_figures(file):
    file.write_text("print('loaded')\n" + file.read_text())
    result = simulated(file, "loud")
    assert (result.code, result.json["loud"], result.err) == (0, 1, "loaded\nlooking\n")


def test_a_replayed_run_shows_the_columns_that_came_on_its_way(file, tmp_path):
    path = tmp_path / "run.parquet"
    session = Session(scenarios.load("hold", {"duration": 0.05, "controller.law": "pd"}))
    file_of_run = TelemetryFile(path, session.signals, record_of(session).metadata())
    file_of_run.write(session.advance(20))
    session.set("controller.law", "afsm")
    file_of_run.write(session.advance(30))
    file_of_run.close(record_of(session).metadata())
    result = simulated(file, "columns", more=("--replay", path))
    assert {"q_rad", "sliding_s"} <= set(result.json["columns"])


def test_telemetry_is_kept_for_own_metrics_alone(file, monkeypatch):
    """Rows of a run of ages do not fit in memory; without a function no memory is taken for rows."""
    message = refusal("simulate", "hold", "--duration", "1e9", "--metric", f"{file}:largest")
    assert "fit in memory" in message
    monkeypatch.setattr(simulate, "TelemetryBuffer", None)
    assert simulated(file).code == 0
