"""``spheretwin sweep``: its two streams, its exit codes, its folder."""

import json
from pathlib import Path

import pytest

from spheretwin import cli
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.study import agreement, report
from spheretwin.study.grid import Grid
from spheretwin.study.study import load as load_study


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(
        'name = "short"\nscenario = "sinusoid"\nfields = {duration = 0.02}\n'
        '[[axis]]\nfield = "disturbance.load"\nkind = "values"\nvalues = [0.0, 1.0, 2.0]\n'
    )
    return str(path)


def test_people_get_a_table_and_a_page(source, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["sweep", source]) == cli.DONE
    out, err = capsys.readouterr()
    assert "short: 3 of 3 rows" in out
    assert "completed" in out
    assert err == ""
    names = {path.name for path in (tmp_path / "short_study").iterdir()}
    assert {"journal.jsonl", "table.parquet", "report.md", "report.html", "report_axis.svg"} <= names


def test_json_stands_alone(source, tmp_path, capsys):
    (tmp_path / "mine.py").write_text("def loud(run):\n    print('here')\n    return 1\n")
    path = Path(source)
    path.write_text('metrics = ["rms_error_rad", "mine.py:loud"]\n' + path.read_text())
    assert cli.main(["sweep", source, "--out", str(tmp_path / "out"), "--json", "--limit", "2"]) == cli.DONE
    out, err = capsys.readouterr()
    told = json.loads(out)
    assert (told["rows"], told["of"], told["failed"], told["resumed"]) == (2, 2, 0, 0)
    assert told["summary"]["afsm"]["loud"] == {"median": 1.0, "range_95": [1.0, 1.0]}
    assert err == "here\nhere\n"


def test_damage_to_the_journal_is_told(source, tmp_path, capsys):
    arguments = ["sweep", source, "--out", str(tmp_path), "--json"]
    cli.main(arguments)
    path = tmp_path / "journal.jsonl"
    path.write_bytes(path.read_bytes().replace(b"completed", b"cmopleted", 1)[:-9])
    capsys.readouterr()
    assert cli.main(arguments) == cli.DONE
    out, err = capsys.readouterr()
    assert json.loads(out)["resumed"] == 1
    assert "the journal ended in a torn line, which was dropped" in err
    assert "1 damaged lines of the journal were skipped, and their rows run again" in err


def test_the_first_of_several_failed_rows_is_named(source, tmp_path, capsys):
    (tmp_path / "mine.py").write_text(
        "def fragile(run):\n    return 1 / (1 - min(run.scenario.disturbance.load, 1))\n"
    )
    path = Path(source)
    path.write_text('metrics = ["mine.py:fragile"]\n' + path.read_text())
    assert cli.main(["sweep", source, "--out", str(tmp_path / "out")]) == cli.FAILED
    keys = [row.key for row in Grid(load_study(source))]
    err = capsys.readouterr().err
    assert [place for place, key in enumerate(keys) if key in err] == [1]
    assert "2 of 3 rows failed" in err


def test_without_matplotlib_there_is_a_table_and_a_word(source, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(report, "can_be_drawn", lambda: False)
    assert cli.main(["sweep", source, "--out", str(tmp_path / "out")]) == cli.DONE
    assert "no report was written: it needs the extra `spheretwin[plots]`" in capsys.readouterr().err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"journal.jsonl", "table.parquet"}


def test_plants_that_differ_are_told_in_one_line(source, tmp_path, capsys, monkeypatch):
    def differ(*_):
        raise SpheretwinError("study short: expected row 0 to be the same on both plants")

    monkeypatch.setattr(agreement, "check", differ)
    assert cli.main(["sweep", source, "--out", str(tmp_path / "out")]) == cli.FAILED
    assert (
        capsys.readouterr().err == "spheretwin: study short: expected row 0 to be the same on both plants\n"
    )


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["papr"], "did you mean paper?"),
        (["paper", "--threads", "0"], "expected a whole number from 1 to 1024, received 0"),
        (["paper", "--threads", "5000"], "expected a whole number from 1 to 1024, received 5000"),
        (["paper", "--limit", "x"], "expected a whole number from 1 to 1000000000000, received x"),
        (["paper", "--row", "0", "--limit", "3"], "expected --row without --out, --threads or --limit"),
        (["paper", "--row", "0"], "expected the key of one of its rows, received 0"),
        (
            ["paper", "--disturbance.load", "1"],
            "expected STUDY, --out, --threads, --engine, --address, --limit, --row, --optimise, --trials,"
            " --figure-format or --json, received",
        ),
    ],
)
def test_bad_input_is_one_line(arguments, told, capsys):
    assert cli.main(["sweep", *arguments]) == cli.BAD_INPUT
    out, err = capsys.readouterr()
    assert out == ""
    assert told in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("load", "code", "status"), [("1.0", cli.DONE, "completed"), ("-1.0", cli.FAILED, "refused")]
)
def test_the_exit_code_of_one_row_is_that_of_its_run(source, tmp_path, capsys, load, code, status):
    path = Path(source)
    path.write_text(path.read_text().replace("disturbance.load", "plant.payload_kg").replace("1.0", load))
    key = Grid(load_study(source))[1].key
    assert cli.main(["sweep", source, "--row", key, "--json"]) == code
    assert json.loads(capsys.readouterr().out)["status"] == status
