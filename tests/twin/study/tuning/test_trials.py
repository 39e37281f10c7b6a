"""Trials that are kept: gone on with after any end, refused where they are others, one process at a time."""

import json
import os
import signal
import subprocess
import sys

import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.study.tuning.tuning import JOURNAL, tune
from tests.twin.study.tuning.cases import FIGURES, TWO, gain, study

TRIALS = 24


def table(folder):
    return (folder / "trials.parquet").read_bytes()


def lines(folder):
    return (folder / JOURNAL).read_bytes().splitlines(keepends=True)


LOCAL = {"sampler": "local", "draws": 10, "perturbations": 14}


@pytest.mark.release("12 s; test_a_killed_process_loses_no_trial_that_it_reported has one")
@pytest.mark.parametrize("sampler", [{"sampler": "tpe"}, {"sampler": "nsga2"}, LOCAL], ids=str)
def test_wherever_a_process_was_killed_it_is_gone_on_as_if_it_had_not_been(tmp_path, sampler):
    noisy = study(tmp_path, **TWO, **sampler)
    tune(noisy, tmp_path, trials=TRIALS, threads=1)
    whole, journal_bytes = table(tmp_path), b"".join(lines(tmp_path))
    # Within a line, behind each line, and behind it but for its end.
    ends = [round(len(journal_bytes) * share) for share in (0.001, 0.02, 0.37, 0.71, 0.99)]
    ends += [place + more for place, byte in enumerate(journal_bytes) if byte == ord("\n") for more in (0, 1)]
    for place, end in enumerate(ends[:-1]):
        folder = tmp_path / str(place)
        folder.mkdir()
        (folder / JOURNAL).write_bytes(journal_bytes[:end])
        result = tune(noisy, folder, trials=TRIALS, threads=2)
        assert result.resumed < TRIALS
        assert result.trials == result.of == TRIALS
        assert table(folder) == whole


KILLED = """
import sys
from pathlib import Path
from spheretwin.study.study import made
from spheretwin.study.tuning.tuning import tune
import json
study = made(json.loads(sys.argv[1]), "known")
print("ready", flush=True)
tune(study, Path(sys.argv[2]), trials=2000, threads=1, done=lambda done, of: print(done, flush=True))
"""


def test_a_killed_process_loses_no_trial_that_it_reported(tmp_path):
    noisy = study(tmp_path, **TWO)
    fields = {**noisy.model_dump(mode="json"), "optimise": noisy.optimise.model_dump(mode="json")}
    arguments = [sys.executable, "-c", KILLED, json.dumps(fields), str(tmp_path / "killed")]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        assert any(line == "9\n" for line in process.stdout)  # it has reported so many trials
        # Another process is kept out as long as this one lives.
        with pytest.raises(InputError, match=r"one process at a time, received .*which another one writes"):
            tune(noisy, tmp_path / "killed", trials=TRIALS)
        os.kill(process.pid, signal.SIGKILL)
    result = tune(noisy, tmp_path / "killed", trials=TRIALS)
    assert result.resumed >= 9
    trials = result.laws[0].trials[:TRIALS]
    assert trials == tune(noisy, tmp_path / "once", trials=TRIALS).laws[0].trials


def test_what_is_stopped_goes_on(tmp_path):
    noisy = study(tmp_path, **TWO, fresh=3)
    asked = iter(range(10**9))
    result = tune(noisy, tmp_path, trials=TRIALS, threads=1, stop_requested=lambda: next(asked) > 8)
    assert 0 < result.trials < result.of == TRIALS
    messages = []
    again = tune(noisy, tmp_path, trials=TRIALS, threads=1, done=lambda done, of: messages.append((done, of)))
    assert again.resumed == result.trials
    assert messages == [(done, TRIALS) for done in range(result.trials, TRIALS + 1)]
    once = tune(noisy, tmp_path / "once", trials=TRIALS, threads=1)
    assert table(tmp_path) == table(tmp_path / "once")
    assert again.laws == once.laws


OTHERS = {
    "range": {"gains": (gain(low=31.0), gain("damping", 5.0, 500.0))},
    "seeds": {"seeds": 4},
    "objectives": {"objectives": ("slowness", "miss")},
    "sampler": {"sampler": "random"},
    "batch": {"together": 3},
    "edited figures": {},
}
ANOTHER_STUDY = r"expected .* to be a journal of this study .* received one of others"


@pytest.mark.parametrize("other", OTHERS)
def test_trials_of_another_study_are_refused(tmp_path, other):
    tune(study(tmp_path, **TWO), tmp_path, trials=4)
    before = (tmp_path / JOURNAL).read_bytes()
    changed = study(tmp_path, **{**TWO, **OTHERS[other]})
    if other == "edited figures":
        (tmp_path / "figures.py").write_text(FIGURES + "# edited\n")
    with pytest.raises(InputError, match=ANOTHER_STUDY):
        tune(changed, tmp_path, trials=4)
    assert (tmp_path / JOURNAL).read_bytes() == before


def test_a_damaged_line_is_run_again_and_what_is_finished_is_not(tmp_path, monkeypatch):
    noisy = study(tmp_path, **TWO)
    tune(noisy, tmp_path, trials=TRIALS)
    whole, journal_lines = table(tmp_path), lines(tmp_path)
    journal_lines[5] = journal_lines[5].replace(b"e", b"f", 1)
    (tmp_path / JOURNAL).write_bytes(b"".join(journal_lines))
    assert tune(noisy, tmp_path, trials=TRIALS).resumed == TRIALS - 1
    assert table(tmp_path) == whole
    before = (tmp_path / JOURNAL).read_bytes()
    monkeypatch.setattr("spheretwin.study.tuning.trials.run_trials", None)
    complete = tune(noisy, tmp_path, trials=TRIALS)
    assert (complete.trials, complete.resumed) == (TRIALS, TRIALS)
    assert (tmp_path / JOURNAL).read_bytes() == before


def test_without_optuna_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "optuna", None)
    message = "expected optuna to look for gains, which the extra tune installs: "
    with pytest.raises(InputError, match=message):
        tune(study(tmp_path, **TWO), tmp_path / "out", trials=4)
