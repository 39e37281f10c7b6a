"""``spheretwin sweep STUDY --optimise``: its two streams, its exit codes, its files."""

import json
import shlex
import signal

import pyarrow.parquet as parquet
import pytest

from spheretwin import cli
from spheretwin.cli import sweep
from spheretwin.models.base.errors import InputError
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

[fields]
duration = 0.005

[[law]]
law = "pd"

[[law]]
law = "pid"

[optimise]
trials = 8
fresh = 2

[[optimise.objective]]
metric = "miss"

[[optimise.objective]]
metric = "slowness"

[[optimise.gain]]
field = "controller.stiffness"
low = 30.0
high = 3000.0
log = true
start = 100.0

[[optimise.gain]]
name = "damping of pd"
field = "controller.damping"
law = "pd"
low = 5.0
high = 500.0
log = true
start = 20.0

[[optimise.gain]]
name = "damping of pid"
field = "controller.damping"
law = "pid"
low = 50.0
high = 500.0
log = true
start = 60.0
"""


@pytest.fixture
def small(tmp_path):
    (tmp_path / "figures.py").write_text(FIGURES)
    path = tmp_path / "small.toml"
    path.write_text(STUDY)
    return str(path)


def test_json_stands_alone_and_files_are_written(small, tmp_path, capsys):
    arguments = ["sweep", small, "--optimise", "--json", "--out", str(tmp_path / "out"), "--threads", "2"]
    assert cli.main(arguments) == cli.DONE
    out, err = capsys.readouterr()
    assert err == ""
    reported = json.loads(out)
    assert (reported["trials"], reported["of"], reported["resumed"]) == (16, 16, 0)
    assert list(reported["laws"]) == ["pd", "pid"]
    files = {path.name for path in (tmp_path / "out").iterdir()}
    pages = {"tuning.md", "tuning.html", "gains.json"}
    assert files == {"trials.jsonl", "trials.parquet", "trials.svg", "front.svg"} | pages
    table = parquet.read_table(reported["table"]).to_pylist()
    for law, of_law in reported["laws"].items():
        assert sum(of_law["ended"].values()) == 8
        assert of_law["start"]["gains"]["controller.stiffness"] == 100.0
        rows = {row["trial"]: row for row in table if row["law"] == law}
        assert {each["trial"] for each in of_law["best"]} == {each for each in rows if rows[each]["best"]}
        for each in of_law["best"]:
            row = rows[each["trial"]]
            assert each["values"] == {name: row[name] for name in ("worst miss", "worst slowness")}
            assert each["values"]["worst miss"] == max(row["worst miss, each row"])
            assert each["gains"][f"damping of {law}"] == each["fields"]["controller.damping"]
            assert row["controller.damping"] == row[f"damping of {law}"]
            assert set(each["fresh"]) == set(each["values"])
        listed = json.loads((tmp_path / "out" / "gains.json").read_text())["laws"][law]
        names = ("trial", "gains", "fields", "values")
        assert listed == [{"limit": None, **{name: each[name] for name in names}} for each in of_law["best"]]
    other = {"pd": "pid", "pid": "pd"}
    assert all(row[f"damping of {other[row['law']]}"] is None for row in table)


def test_the_command_of_a_single_best_trial_is_printed(small, tmp_path, capsys):
    path = tmp_path / "one.toml"
    path.write_text(STUDY.replace('[[optimise.objective]]\nmetric = "slowness"\n', ""))
    arguments = ["sweep", str(path), "--optimise", "--trials", "3", "--out", str(tmp_path / "out")]
    assert cli.main(arguments) == cli.DONE
    lines = capsys.readouterr().out.splitlines()
    assert cli.main([*arguments, "--json"]) == cli.DONE
    for of_law in json.loads(capsys.readouterr().out)["laws"].values():
        (best,) = of_law["best"]
        assert best["command"] in lines


LIMITED = """
name = "limited"
scenario = "hold"
metrics = ["figures.py:miss", "figures.py:slowness"]

[fields]
duration = 0.005
"controller.law" = "pd"

[optimise]
sampler = "local"
draws = 12
perturbations = 4
gain = [
    { field = "controller.stiffness", low = 30.0, high = 3000.0, log = true, reason = "about 300" },
    { field = "controller.damping", low = 5.0, high = 500.0, log = true, optional = true },
]

[[optimise.objective]]
metric = "miss"

[[optimise.objective]]
metric = "slowness"
limits = [0.01, 0.7, 9.0]
"""


def test_the_best_within_each_limit_is_written_and_printed(tmp_path, capsys):
    (tmp_path / "figures.py").write_text(FIGURES)
    path = tmp_path / "limited.toml"
    path.write_text(LIMITED)
    arguments = ["sweep", str(path), "--optimise", "--out", str(tmp_path / "out"), "--threads", "2"]
    assert cli.main(arguments) == cli.DONE
    printed = capsys.readouterr().out
    reported = json.loads((tmp_path / "out" / "gains.json").read_text())["laws"]["pd"]
    # No damping within the range is as little as 0.01 of slowness.
    assert [each["limit"] for each in reported] == [0.7, 9.0]
    table = parquet.read_table(tmp_path / "out" / "trials.parquet").to_pylist()
    assert len(table) == 12 + 3 * 4
    for each in reported:
        completed = [row for row in table if row["ended"] == "completed"]
        within = [row for row in completed if row["worst slowness"] <= each["limit"]]
        best = min(within, key=lambda row: row["worst miss"])
        assert each["trial"] == best["trial"]
        is_on = best["controller.damping, on"] >= 0.5
        assert ("controller.damping" in each["fields"]) == is_on
        assert (each["gains"]["controller.damping"] is None) == (not is_on)
    text = (tmp_path / "out" / "tuning.md").read_text(encoding="utf-8")
    assert "chosen: 0.01, 0.7, 9." in text
    assert "about 300" in text
    assert "500, or off" in text
    some_off = any(each["gains"]["controller.damping"] is None for each in reported)
    assert some_off == ("off" in printed)


def test_the_page_has_every_law_its_front_and_its_figures(small, tmp_path, capsys):
    assert cli.main(["sweep", small, "--optimise", "--json", "--out", str(tmp_path / "out")]) == cli.DONE
    laws = json.loads(capsys.readouterr().out)["laws"]
    text = (tmp_path / "out" / "tuning.md").read_text(encoding="utf-8")
    for law, of_law in laws.items():
        _, _, section = text.partition(f"\n## {law}\n")
        rows = [
            line.split("|")[1].strip() for line in section.partition("\n## ")[0].splitlines() if "|" in line
        ]
        assert rows[2:] == ["start", *(str(each["trial"]) for each in of_law["best"])]
    for file, label in (("trials.svg", "best so far"), ("front.svg", "start")):
        assert f"]({file})" in text
        figure = (tmp_path / "out" / file).read_text(encoding="utf-8")
        assert all(f">{law}, {label}</text>" in figure for law in laws)
    assert f"Created by `spheretwin sweep {small} --optimise` with python" in text
    assert "16 of 16 trials are finished." in text.partition("- [Method]")[0]
    # The words of a gain stand next to the fields that it sets; no other table has these.
    assert "| controller stiffness | all | 30 | 3000 | `controller.stiffness` |" in text
    assert "controller.stiffness" not in text.partition("## Figures")[2].partition("---\n")[0].replace(
        "`", ""
    )


@pytest.mark.parametrize(
    ("objective", "words"),
    [
        ({"metric": "max_abs_error_rad"}, "worst largest error, rad"),
        ({"metric": "max_abs_error_rad", "of": ("alpha", "beta")}, "worst largest error, rad (alpha, beta)"),
        ({"metric": "current_variation_A_s", "over": "median"}, "median current variation, A/s"),
        ({"metric": "rms_torque_Nm", "over": "geometric_mean"}, "geometric mean rms torque, N·m"),
        ({"metric": "slowness"}, "worst slowness"),
    ],
)
def test_objectives_are_words_with_their_unit(objective, words):
    made = Objective(**objective)
    trial = {"trial": 1, "gains": {}, "fields": {"controller.damping": 1.0}, "ended": "completed"}
    trial |= {"values": {made.called: 2.0}, "fresh": None, "fresh_reason": None}
    head, _ = report.chosen({"start": None, "best": [trial]})
    assert head == ["trial", "controller damping", words]


@pytest.mark.release("0.8 s; content of study_tuning has the command")
def test_the_command_that_is_told_runs_the_gains(small, tmp_path, capsys):
    assert cli.main(["sweep", small, "--optimise", "--json", "--out", str(tmp_path / "out")]) == cli.DONE
    best = json.loads(capsys.readouterr().out)["laws"]["pd"]["best"][0]
    words = shlex.split(best["command"])
    assert words[:3] == ["spheretwin", "simulate", "hold"]
    reference = str(tmp_path / "figures.py:miss")
    more = [] if reference in words else ["--metric", reference]
    assert cli.main([*words[1:], *more, "--json"]) == cli.DONE
    reported = json.loads(capsys.readouterr().out)
    row = parquet.read_table(tmp_path / "out" / "trials.parquet").to_pylist()[best["trial"]]
    assert reported["miss"] == row["worst miss, each row"][0]


def test_people_get_the_start_the_front_and_where_all_is(small, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "150")  # wide enough for headings on one line
    assert cli.main(["sweep", small, "--optimise", "--out", str(tmp_path / "out")]) == cli.DONE
    out, err = capsys.readouterr()
    assert err == ""
    for word in ("small, pd", "small, pid", "start", "damping of pid", "fresh", "trials.parquet"):
        assert word in out


def test_without_matplotlib_there_are_trials_and_a_word(small, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(study_report, "find_spec", lambda name: None)
    assert cli.main(["sweep", small, "--optimise", "--json", "--out", str(tmp_path / "out")]) == cli.DONE
    out, err = capsys.readouterr()
    assert json.loads(out)["trials"] == 16
    assert (
        err
        == f"spheretwin: sweep: no figures were drawn: {install_command('plots')} installs what they need\n"
    )
    assert list((tmp_path / "out").glob("*.svg")) == []
    assert "![" not in (tmp_path / "out" / "tuning.md").read_text(encoding="utf-8")


@pytest.mark.release("0.9 s; test_trials.py has interrupted searches")
def test_what_is_interrupted_exits_1_and_goes_on(small, tmp_path, capsys, monkeypatch):
    tune = sweep.tune

    def interrupted(*arguments, done, **more):
        def printed_report(trials, of):
            if trials == 4:
                signal.raise_signal(signal.SIGINT)
            done(trials, of)

        return tune(*arguments, done=printed_report, **more)

    arguments = ["sweep", small, "--optimise", "--json", "--out", str(tmp_path / "out"), "--threads", "1"]
    with monkeypatch.context() as patch:
        patch.setattr(sweep, "tune", interrupted)
        assert cli.main(arguments) == cli.FAILED
    out, err = capsys.readouterr()
    trials = json.loads(out)["trials"]
    assert 4 <= trials < 16
    assert err == (
        f"spheretwin: sweep: interrupted after {trials} of 16 trials; the same command continues from there\n"
    )
    assert cli.main(arguments) == cli.DONE
    assert json.loads(capsys.readouterr().out)["resumed"] == trials


BAD = {
    "--trials alone": (["tuning", "--trials", "5"], "expected --trials with --optimise, received it alone"),
    "with a row": (["tuning", "--optimise", "--row", "abc"], "expected --optimise without --row and --limit"),
    "with a limit": (["tuning", "--optimise", "--limit", "3"], "expected --optimise without --row"),
    "no gains": (["paper", "--optimise"], "study paper: expected [optimise] in a study that is tuned"),
    "no number": (["tuning", "--optimise", "--trials", "0"], "expected a whole number from 1 to"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_is_refused_in_a_line(case, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments, message = BAD[case]
    assert cli.main(["sweep", *arguments]) == cli.BAD_INPUT
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_sweep_of_the_same_study_leaves_its_gains_alone(small, tmp_path, capsys):
    """What [optimise] says is no part of a sweep: its journal is gone on with when it changes."""
    arguments = ["sweep", small, "--json", "--out", str(tmp_path / "out"), "--threads", "1"]
    assert cli.main(arguments) == cli.DONE
    assert json.loads(capsys.readouterr().out)["resumed"] == 0
    (tmp_path / "small.toml").write_text(STUDY.replace("trials = 8", "trials = 9"))
    assert cli.main(arguments) == cli.DONE
    assert json.loads(capsys.readouterr().out)["resumed"] == 4


def test_a_bad_section_is_refused_by_name(small, tmp_path):
    (tmp_path / "small.toml").write_text(STUDY.replace('metric = "miss"', 'metrik = "miss"'))
    with pytest.raises(InputError) as refusal:
        sweep.load(small)
    assert "optimise.objective.0.metric: expected a value, received none" in str(refusal.value)
