"""``spheretwin sweep STUDY --optimise``: its two streams, its exit codes, its files."""

import json
import signal

import pyarrow.parquet as parquet
import pytest

from spheretwin import cli
from spheretwin.cli import sweep
from spheretwin.models.base.extras import install_command
from spheretwin.study import report as study_report
from spheretwin.study.optimise import Objective
from spheretwin.study.tuning import report
from tests.twin.study.tuning.cases import FIGURES

STUDY = """
name = "small"
scenario = "hold"
seeds = 2
metrics = ["figures.py:miss", "figures.py:slowness"]
law = [{ law = "pd" }, { law = "pid" }]
fields = { duration = 0.005 }

[optimise]
trials = 8
fresh = 2
objective = [{ metric = "miss" }, { metric = "slowness" }]
gain = [
    { field = "controller.stiffness", low = 30.0, high = 3000.0, log = true, start = 100.0 },
    { name = "damping of pd", field = "controller.damping", law = "pd", low = 5, high = 500, start = 20 },
    { name = "damping of pid", field = "controller.damping", law = "pid", low = 5, high = 500, start = 60 },
]
"""

LIMITED = """
name = "limited"
scenario = "hold"
metrics = ["figures.py:miss", "figures.py:slowness"]
fields = { duration = 0.005, "controller.law" = "pd" }

[optimise]
sampler = "local"
draws = 12
perturbations = 4
objective = [{ metric = "miss" }, { metric = "slowness", limits = [0.01, 0.7, 9.0] }]
gain = [
    { field = "controller.stiffness", low = 30.0, high = 3000.0, log = true, reason = "about 300" },
    { field = "controller.damping", low = 5.0, high = 500.0, log = true, optional = true },
]
"""


@pytest.fixture
def optimise(tmp_path):
    """Tune a study with its results in ``out``; returns the exit code."""
    (tmp_path / "figures.py").write_text(FIGURES)
    path = tmp_path / "study.toml"

    def run(*more, text=STUDY):
        path.write_text(text)
        return cli.main(["sweep", str(path), "--optimise", "--out", str(tmp_path / "out"), *more])

    return run


def trials_in(folder):
    return parquet.read_table(folder / "out" / "trials.parquet").to_pylist()


def test_json_stands_alone_and_files_are_written(optimise, tmp_path, capsys):
    assert optimise("--json", "--threads", "2") == cli.DONE
    out, err = capsys.readouterr()
    reported = json.loads(out)
    assert (err, reported["trials"], reported["of"], reported["resumed"]) == ("", 16, 16, 0)
    assert list(reported["laws"]) == ["pd", "pid"]
    files = {path.name for path in (tmp_path / "out").iterdir()}
    pages = {"tuning.md", "tuning.html", "gains.json"}
    assert files == {"trials.jsonl", "trials.parquet", "trials.svg", "front.svg"} | pages
    table = trials_in(tmp_path)
    for law, of_law in reported["laws"].items():
        assert of_law["start"]["gains"]["controller.stiffness"] == 100.0
        rows = {row["trial"]: row for row in table if row["law"] == law}
        assert {each["trial"] for each in of_law["best"]} == {each for each in rows if rows[each]["best"]}
        for each in of_law["best"]:
            row = rows[each["trial"]]
            assert each["values"] == {name: row[name] for name in each["fresh"]}
            assert each["gains"][f"damping of {law}"] == each["fields"]["controller.damping"]
            assert row["controller.damping"] == row[f"damping of {law}"]
        listed = json.loads((tmp_path / "out" / "gains.json").read_text())["laws"][law]
        names = ("trial", "gains", "fields", "values")
        assert listed == [{"limit": None, **{name: each[name] for name in names}} for each in of_law["best"]]
    other = {"pd": "pid", "pid": "pd"}
    assert all(row[f"damping of {other[row['law']]}"] is None for row in table)


def test_the_command_of_a_single_best_trial_is_printed(optimise, capsys):
    single = STUDY.replace(', { metric = "slowness" }', "")
    assert optimise("--trials", "3", text=single) == cli.DONE
    lines = capsys.readouterr().out.splitlines()
    assert optimise("--trials", "3", "--json", text=single) == cli.DONE
    for of_law in json.loads(capsys.readouterr().out)["laws"].values():
        (best,) = of_law["best"]
        assert best["command"] in lines


def test_the_best_within_each_limit_is_written_and_printed(optimise, tmp_path, capsys):
    assert optimise("--threads", "2", text=LIMITED) == cli.DONE
    printed = capsys.readouterr().out
    reported = json.loads((tmp_path / "out" / "gains.json").read_text())["laws"]["pd"]
    # No damping within the range is as little as 0.01 of slowness.
    assert [each["limit"] for each in reported] == [0.7, 9.0]
    table = trials_in(tmp_path)
    assert len(table) == 12 + 3 * 4
    completed = [row for row in table if row["ended"] == "completed"]
    for each in reported:
        within = [row for row in completed if row["worst slowness"] <= each["limit"]]
        best = min(within, key=lambda row: row["worst miss"])
        assert each["trial"] == best["trial"]
        is_on = best["controller.damping, on"] >= 0.5
        assert ("controller.damping" in each["fields"]) == is_on
        assert (each["gains"]["controller.damping"] is None) == (not is_on)
    text = (tmp_path / "out" / "tuning.md").read_text(encoding="utf-8")
    assert all(part in text for part in ("chosen: 0.01, 0.7, 9.", "about 300", "500, or off"))
    some_off = any(each["gains"]["controller.damping"] is None for each in reported)
    assert some_off == ("off" in printed)


OBJECTIVES = {
    "worst largest error, rad": {"metric": "max_abs_error_rad"},
    "worst largest error, rad (alpha, beta)": {"metric": "max_abs_error_rad", "of": ("alpha", "beta")},
    "median current variation, A/s": {"metric": "current_variation_A_s", "over": "median"},
    "geometric mean rms torque, N·m": {"metric": "rms_torque_Nm", "over": "geometric_mean"},
    "worst slowness": {"metric": "slowness"},
}


@pytest.mark.parametrize("words", OBJECTIVES)
def test_objectives_are_words_with_their_unit(words):
    made = Objective(**OBJECTIVES[words])
    trial = {"trial": 1, "gains": {}, "fields": {"controller.damping": 1.0}, "ended": "completed"}
    trial |= {"values": {made.called: 2.0}, "fresh": None, "fresh_reason": None}
    head, _ = report.chosen({"start": None, "best": [trial]})
    assert head == ["trial", "controller damping", words]


def test_people_get_the_start_the_front_and_the_path_of_the_trials(optimise, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "150")  # wide enough for headings on one line
    assert optimise() == cli.DONE
    out, err = capsys.readouterr()
    assert err == ""
    for word in ("small, pd", "small, pid", "start", "damping of pid", "fresh", "trials.parquet"):
        assert word in out


def test_without_matplotlib_there_are_trials_and_a_message(optimise, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(study_report, "find_spec", lambda name: None)
    assert optimise("--json") == cli.DONE
    out, err = capsys.readouterr()
    assert json.loads(out)["trials"] == 16
    install = install_command("plots")
    assert err == f"spheretwin: sweep: no figures were drawn: {install} installs what they need\n"
    assert list((tmp_path / "out").glob("*.svg")) == []
    assert "![" not in (tmp_path / "out" / "tuning.md").read_text(encoding="utf-8")


@pytest.mark.release("0.9 s; test_trials.py has interrupted searches")
def test_what_is_interrupted_exits_1_and_goes_on(optimise, capsys, monkeypatch):
    tune = sweep.tune

    def interrupted(*arguments, done, **more):
        def report_and_interrupt(trials, of):
            if trials == 4:
                signal.raise_signal(signal.SIGINT)
            done(trials, of)

        return tune(*arguments, done=report_and_interrupt, **more)

    with monkeypatch.context() as patch:
        patch.setattr(sweep, "tune", interrupted)
        assert optimise("--json", "--threads", "1") == cli.FAILED
    out, err = capsys.readouterr()
    trials = json.loads(out)["trials"]
    assert 4 <= trials < 16
    interruption = f"interrupted after {trials} of 16 trials; the same command continues from there"
    assert err == f"spheretwin: sweep: {interruption}\n"
    assert optimise("--json", "--threads", "1") == cli.DONE
    assert json.loads(capsys.readouterr().out)["resumed"] == trials


def test_a_sweep_of_the_same_study_leaves_its_gains_alone(tmp_path, capsys):
    """The section [optimise] is no part of a sweep: its journal is continued when the section changes."""
    (tmp_path / "figures.py").write_text(FIGURES)
    path = tmp_path / "study.toml"
    for text, resumed in ((STUDY, 0), (STUDY.replace("trials = 8", "trials = 9"), 4)):
        path.write_text(text)
        arguments = ["sweep", str(path), "--json", "--out", str(tmp_path / "out"), "--threads", "1"]
        assert cli.main(arguments) == cli.DONE
        assert json.loads(capsys.readouterr().out)["resumed"] == resumed
