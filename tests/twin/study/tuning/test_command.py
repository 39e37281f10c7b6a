"""``spheretwin sweep STUDY --optimise``: its two streams, its exit codes, its files."""

import json
import signal

import pytest

from spheretwin import cli
from spheretwin.cli import sweep
from spheretwin.models.base.extras import install_command
from spheretwin.study import report as study_report
from tests.twin.study.tuning.cases import FIGURES, STUDY


@pytest.fixture
def optimise(tmp_path):
    """Tune a study with its results in ``out``; returns the exit code."""
    (tmp_path / "figures.py").write_text(FIGURES)
    path = tmp_path / "study.toml"

    def run(*more, text=STUDY):
        path.write_text(text)
        return cli.main(["sweep", str(path), "--optimise", "--out", str(tmp_path / "out"), *more])

    return run


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
