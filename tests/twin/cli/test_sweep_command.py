"""``spheretwin sweep``: its two streams, its exit codes, its folder."""

from pathlib import Path

import pytest

from spheretwin import cli
from spheretwin.cli import sweep
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.base.extras import install_command
from spheretwin.study import report
from spheretwin.study.grid import Grid
from spheretwin.study.runner import run as run_study
from spheretwin.study.study import load as load_study
from tests.twin.cli.calls import call, succeeded


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(
        'name = "short"\nscenario = "sinusoid"\nfields = {duration = 0.02}\n'
        '[[axis]]\nfield = "disturbance.load"\nkind = "values"\nvalues = [0.0, 1.0, 2.0]\n'
    )
    return str(path)


@pytest.fixture
def with_metric(source, tmp_path):
    """Add a function of a file to the metrics of the study."""

    def add(name, statement):
        (tmp_path / "mine.py").write_text(f"def {name}(run):\n    {statement}\n")
        path = Path(source)
        path.write_text(f'metrics = ["rms_error_rad", "mine.py:{name}"]\n' + path.read_text())

    return add


def test_a_study_without_a_folder_has_one_of_its_name(source, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "short: 3 of 3 rows" in succeeded("sweep", source)
    names = {path.name for path in (tmp_path / "short_study").iterdir()}
    assert {"journal.jsonl", "table.parquet", "report.md", "report.html", "report_axis.svg"} <= names


def test_json_stands_alone(source, tmp_path, with_metric):
    with_metric("loud", "return print('here') or 1")
    result = call("sweep", source, "--out", tmp_path / "out", "--json", "--limit", "2")
    assert (result.code, result.err) == (cli.DONE, "here\nhere\n")
    both = {"median_95": [None, None], "range_95": [1.0, 1.0]}
    assert result.json["summary"]["afsm"]["loud"] == {"median": 1.0, **both}


def test_damage_to_the_journal_is_told(source, tmp_path):
    arguments = ["sweep", source, "--out", tmp_path, "--json"]
    call(*arguments)
    path = tmp_path / "journal.jsonl"
    path.write_bytes(path.read_bytes().replace(b"completed", b"cmopleted", 1)[:-9])
    result = call(*arguments)
    assert (result.code, result.json["resumed"]) == (cli.DONE, 1)
    assert "the journal ended in a torn line, which was dropped" in result.err
    assert "1 damaged lines of the journal were skipped, and their rows run again" in result.err


def test_the_first_of_several_failed_rows_is_named(source, tmp_path, with_metric):
    with_metric("fragile", "return 1 / (1 - min(run.scenario.disturbance.load, 1))")
    result = call("sweep", source, "--out", tmp_path / "out")
    assert result.code == cli.FAILED
    keys = [row.key for row in Grid(load_study(source))]
    assert [place for place, key in enumerate(keys) if key in result.err] == [1]
    assert "2 of 3 rows failed" in result.err


def test_without_matplotlib_there_is_a_table_and_a_word(source, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "can_be_drawn", lambda: False)
    result = call("sweep", source, "--out", tmp_path / "out")
    assert result.code == cli.DONE
    assert f"no report was written: {install_command('plots')}" in result.err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"journal.jsonl", "table.parquet"}


@pytest.mark.parametrize(
    ("rows", "of", "startup_s", "code"),
    [(3, 3, 1.26, cli.DONE), (2, 3, None, cli.FAILED), (4, 3, 0.0, cli.DONE)],
)
def test_a_study_that_is_not_complete_exits_1(source, tmp_path, monkeypatch, rows, of, startup_s, code):
    def run(*arguments, **options):
        result = run_study(*arguments, **options)
        return result._replace(rows=rows, of=of, wall_s=12.34, startup_s=startup_s)

    monkeypatch.setattr(sweep, "run_study", run)
    monkeypatch.setattr(report, "can_be_drawn", lambda: True)
    monkeypatch.setattr(report, "write", lambda *_: ["a", "b"])
    result = call("sweep", source, "--out", tmp_path / "out")
    lines = result.out.splitlines()
    took = [] if startup_s is None else [f"took   12.3 s, {startup_s:.1f} s of it to start"]
    table = f"table  {tmp_path / 'out' / 'table.parquet'}"
    assert lines[0].startswith(f"short: {rows} of {of} rows")
    assert lines[-3 - len(took) :] == [*took, table, "written  a", "written  b"]
    left = f"interrupted after {rows} of {of} rows; the same command continues from there"
    assert (result.code, result.err) == (code, f"spheretwin: sweep: {left}\n" if code else "")


def test_a_study_is_run_with_its_options(source, tmp_path, monkeypatch):
    def refuse(study, folder, **options):
        del options["done"], options["stop_requested"]
        received.append((study.name, folder, options))
        raise SpheretwinError("no more")

    received = []
    monkeypatch.setattr(sweep, "run_study", refuse)
    plain = {"engine": "local", "address": None, "threads": None, "limit": None}
    chosen = {"engine": "ray", "address": "auto", "threads": 3, "limit": 2}
    flags = [text for name, value in chosen.items() for text in (f"--{name}", value)]
    assert call("sweep", source).code == cli.FAILED
    assert call("sweep", source, "--out", tmp_path / "out", *flags).code == cli.FAILED
    assert received == [("short", None, plain), ("short", tmp_path / "out", chosen)]


@pytest.mark.parametrize(
    ("trials", "shown"), [(1, [0]), (15, range(15)), (16, range(0, 16, 2)), (40, range(0, 40, 3))]
)
def test_a_long_front_is_printed_at_even_places(capsys, monkeypatch, trials, shown):
    front = [{"trial": place, "command": f"command {place}"} for place in range(trials)]
    printed = []
    monkeypatch.setattr(
        sweep.tuning_page,
        "chosen",
        lambda of_law, title: (title, [], [trial["trial"] for trial in of_law["best"]], 1),
    )
    monkeypatch.setattr(sweep.tuning_page, "counted", lambda of_law: f"{len(of_law['best'])} counted")
    monkeypatch.setattr(sweep.runs, "print_rows", lambda *table: printed.append(table))
    sweep._print_laws("short", {"pd": {"best": front}})
    lines = capsys.readouterr().out.splitlines()
    assert printed == [("short, pd", [], list(shown), 1)]
    some = [f"{len(shown)} of the {trials} trials of the front"] if len(shown) < trials else []
    command = ["command 0"] if trials == 1 else []
    assert lines == [f"{trials} counted", *some, *command]
