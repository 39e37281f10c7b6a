"""Rows on a GPU: in numba's simulator, against rows in threads."""

import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.study.runner import run
from spheretwin.study.tuning.tuning import tune
from tests.twin.study.cases import rows_of, run_rows, study, values

FIELDS = {"duration": 0.004, "hardware": "electronics"}
AXES = (
    values("disturbance.load", 0.0, 1.0, 2.0),
    {"field": "plant.modelling_error", "kind": "uniform", "low": 0.0, "high": 0.4},
)


@pytest.mark.uncompiled
def test_the_table_is_that_of_the_processor(tmp_path):
    short = study(*AXES, samples=3, fields=FIELDS, law=[{"law": "pd"}, {"law": "afsm"}])
    here, there = tmp_path / "here", tmp_path / "there"
    assert run_rows(short, there, engine="cuda") == run_rows(short, here)


@pytest.mark.uncompiled
def test_a_journal_is_of_one_arithmetic(tmp_path):
    short = study(values("disturbance.load", 0.0, 1.0), fields=FIELDS)
    run(short, tmp_path, limit=1)
    with pytest.raises(InputError, match="another"):
        run(short, tmp_path, engine="cuda")
    assert len(rows_of(tmp_path)) == 1


@pytest.mark.uncompiled
@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"fields": {"plant.engine": "mujoco"}}, "expected plant.engine lagrangian, received mujoco"),
        ({"metrics": ["own.py:peak"]}, "expected figures of this package, received own.py:peak"),
    ],
)
def test_refuses_what_a_gpu_does_not_run(tmp_path, monkeypatch, more, message):
    (tmp_path / "own.py").write_text("def peak(run):\n    return 1.0\n")
    monkeypatch.chdir(tmp_path)
    own = study(values("disturbance.load", 0.0), **more)
    with pytest.raises(InputError, match=message):
        run(own, tmp_path, engine="cuda")


OPTIMISE = {
    "trials": 4,
    "sampler": "random",
    "gain": [{"field": "controller.stiffness", "low": 100.0, "high": 900.0, "log": True}],
    "objective": [{"metric": "rms_error_rad"}],
}


@pytest.mark.uncompiled
def test_a_tuning_has_the_trials_of_the_processor(tmp_path):
    tuned = study(values("disturbance.load", 0.0, 1.0), fields=FIELDS, law=[{"law": "pd"}], optimise=OPTIMISE)
    here, there = (tune(tuned, tmp_path / engine, engine=engine).laws for engine in ("local", "cuda"))
    assert there == here
    assert len(here[0].trials) == OPTIMISE["trials"]


def test_a_tuning_refuses_engines_of_other_processes(tmp_path):
    tuned = study(values("disturbance.load", 0.0), optimise=OPTIMISE)
    with pytest.raises(InputError, match="tuning: expected engine local or cuda, received ray"):
        tune(tuned, tmp_path, engine="ray")
