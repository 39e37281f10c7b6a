"""``spheretwin reproduce``: its two streams, its exit codes, its page."""

import json
import subprocess
import sys

import pytest

from spheretwin import cli
from spheretwin.cli import reproduce
from spheretwin.paper.experiment import Finding
from spheretwin.viz.terminal.texts import Verdict
from tests.twin.paper.cases import IDEAL, LOST, experiment

COMMAND = [sys.executable, "-m", "spheretwin", "reproduce"]


@pytest.mark.release("3 s; content of the paper has the pages")
def test_json_stands_alone_and_the_page_is_written(tmp_path):
    folder = tmp_path / "page"
    arguments = ["figure11", "--json", "--seeds", "2", "--limit", "4", "--out", str(folder)]
    done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads(done.stdout)
    assert set(report) == {"rows", "seeds", "wall_s", "versions"}
    assert [row["controller"] for row in report["rows"]] == ["pd", "adaptive_fuzzy", "afsm", "pid"]
    for row in report["rows"]:
        assert (row["figure"], row["m"], row["L"], row["seeds"], row["status"]) == (
            "figure11",
            0,
            0,
            2,
            "completed",
        )
        assert len(row["max_abs_error_rad"]) == len(row["tail_rms_error_rad"]) == 3
    assert {"reproduce.md", "reproduce.html", "figure11_errors.svg"} <= {
        path.name for path in folder.iterdir()
    }
    text = (folder / "reproduce.md").read_text(encoding="utf-8")
    assert "`spheretwin reproduce figure11 --seeds 2 --limit 4`" in text


def test_the_page_states_the_command_with_all_options(tmp_path, monkeypatch):
    monkeypatch.setitem(reproduce.EXPERIMENTS, "short", experiment(IDEAL))
    options = ["--seeds", "1", "--limit", "3", "--plant", "lagrangian"]
    assert cli.main(["reproduce", "short", *options, "--out", str(tmp_path)]) == cli.DONE
    text = (tmp_path / "reproduce.md").read_text(encoding="utf-8")
    assert f"`{' '.join(['spheretwin', 'reproduce', 'short', *options])}`" in text


def test_people_get_tables(capsys, monkeypatch):
    monkeypatch.setitem(reproduce.EXPERIMENTS, "short", experiment(IDEAL))
    assert cli.main(["reproduce", "short", "--seeds", "1", "--verbose"]) == cli.DONE
    out, err = capsys.readouterr()
    assert "short, What | was found. Errors" in out
    assert "ideal" in out
    assert err == ""


def test_a_verdict_for_each_experiment_fits_one_screen(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    results = [
        Finding(True, "the order holds" + " under every condition" * 9),
        Finding(False, "the size is 0.36 of the printed one"),
    ]
    names = [f"figure{number}" for number in range(10)]
    short = experiment(IDEAL, findings=lambda outcomes: results)
    monkeypatch.setattr(reproduce, "EXPERIMENTS", {name: short._replace(name=name) for name in names})
    assert cli.main(["reproduce", "all", "--seeds", "1"]) == cli.DONE
    lines = capsys.readouterr().out.splitlines()
    assert 2 * len(names) < len(lines) <= 40
    assert max(map(len, lines)) <= 80
    assert [line for line in lines if line.startswith("figure")] == [
        f"{name}: 1 of 2 results reproduced. A short one" for name in names
    ]
    # The failed comparison comes first: it is never cut.
    after = [lines[place + 1] for place, line in enumerate(lines) if line.startswith("figure")]
    assert set(after) == {"  - not reproduced: the size is 0.36 of the printed one."}
    assert "Errors" not in "\n".join(lines)
    assert cli.main(["reproduce", "figure3", "--seeds", "1"]) == cli.DONE
    alone = " ".join(capsys.readouterr().out.split())
    assert f"reproduced: {results[0].text}." in alone


@pytest.mark.parametrize(
    ("results", "verdict"),
    [
        ([], "no verdict"),
        ([(None, "a")], "not in the paper"),
        ([(True, "a"), (None, "b")], "reproduced"),
        ([(False, "a")], "not reproduced"),
        ([(False, "a"), (True, "b"), (True, "c")], "2 of 3 results reproduced"),
    ],
)
def test_the_verdict_counts_the_results_of_the_paper(results, verdict):
    assert Verdict("figure6", "Figure 6", results).text().partition(":")[0] == verdict


def test_names_are_run_once_each_and_all_is_all(capsys, monkeypatch):
    monkeypatch.setattr(
        reproduce, "EXPERIMENTS", {name: experiment(IDEAL)._replace(name=name) for name in "ab"}
    )
    for names in (["all"], ["b", "a", "b"]):
        assert cli.main(["reproduce", *names, "--json"]) == cli.DONE
        rows = json.loads(capsys.readouterr().out)["rows"]
        assert [row["figure"] for row in rows] == ["a", "b"]


def test_a_run_that_ends_early_exits_1_and_is_named(capsys, monkeypatch):
    monkeypatch.setitem(reproduce.EXPERIMENTS, "short", experiment(IDEAL, LOST))
    assert cli.main(["reproduce", "short", "--json"]) == cli.FAILED
    out, err = capsys.readouterr()
    assert [row["status"] for row in json.loads(out)["rows"]] == ["completed", "left_workspace"]
    assert err == "spheretwin: reproduce: ended early: short: lost (left_workspace)\n"


def test_a_law_without_what_a_figure_varies_is_bad_input(tmp_path, monkeypatch, capsys):
    case = IDEAL._replace(fields={"controller.law": "pd", "controller.surface_slope": 5.0})
    monkeypatch.setitem(reproduce.EXPERIMENTS, "short", experiment(case))
    assert cli.main(["reproduce", "short", "--out", str(tmp_path / "page")]) == cli.BAD_INPUT
    _, err = capsys.readouterr()
    (line,) = err.splitlines()
    assert "reproduce short, ideal" in line
    assert "surface_slope" in line
    assert list(tmp_path.iterdir()) == []


def test_rows_run_on_the_plant_that_is_asked_for(capsys, monkeypatch):
    case = IDEAL._replace(fields={"duration": 0.05})
    monkeypatch.setitem(reproduce.EXPERIMENTS, "short", experiment(case))
    for flags, plant in (([], "lagrangian"), (["--plant", "mujoco"], "mujoco")):
        assert cli.main(["reproduce", "short", "--json", *flags]) == cli.DONE
        (row,) = json.loads(capsys.readouterr().out)["rows"]
        assert row["plant"] == plant
        assert f"--plant.engine {plant}" in row["command"]
