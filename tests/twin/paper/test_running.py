"""Cases and seeds over threads: each run once, in an order of their own, and what ends early is told."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.models.base.errors import InputError
from spheretwin.paper.page import rows
from spheretwin.paper.runner import (
    DATA,
    MEASURED,
    make_plan,
    measured_error,
    measured_max_abs_error,
    outcome_of,
    run_plan,
    unexpected_ends,
)
from spheretwin.simulation import simulate
from spheretwin.study.row import RowResult
from tests.twin.paper.cases import IDEAL, LOST, NOISY, allowed, experiment


def test_rows_are_the_same_bytes_whatever_the_threads():
    plan = make_plan(experiment(NOISY, IDEAL, NOISY._replace(name="again")), seeds=5)
    messages = [json.dumps(rows(plan, run_plan(plan, threads=workers))) for workers in (1, 2, 7)]
    assert messages[0] == messages[1] == messages[2]
    noisy, ideal, again = json.loads(messages[0])
    assert (noisy["seeds"], ideal["seeds"]) == (5, 1)
    assert {**again, "case": "noisy"} == noisy


def test_an_outcome_is_that_of_its_case_and_seed():
    plan = make_plan(experiment(NOISY), seeds=3)
    result = run_plan(plan)["noisy"]
    for seed, outcome in enumerate(result):
        run = simulate(scenarios.load("tilt", {**NOISY.fields, "seed": seed}))
        table = run.telemetry
        np.testing.assert_array_equal(outcome.max_abs_error, np.abs(table["error_rad"]).max(axis=0))
        measured = np.abs(table["q_measured_rad"] - table["q_ref_rad"])
        np.testing.assert_array_equal(outcome.measured_max_abs_error, measured.max(axis=0))
        assert not np.array_equal(outcome.measured_max_abs_error, outcome.max_abs_error)
    ideal = simulate(scenarios.load("tilt", IDEAL.fields))
    np.testing.assert_array_equal(measured_error(ideal), ideal.telemetry["error_rad"])


def test_every_run_is_told_of_once():
    messages = []
    plan = make_plan(experiment(NOISY, IDEAL), seeds=3)
    run_plan(plan, messages.append)
    assert sorted(messages) == ["ideal", "noisy", "noisy", "noisy"]


def test_a_limit_leaves_the_first_cases():
    plan = make_plan(experiment(NOISY, IDEAL, LOST), seeds=2, limit=1)
    assert [case.name for case in plan.cases] == ["noisy"]
    assert list(run_plan(plan)) == ["noisy"]


def test_what_is_kept_of_a_run_is_handed_on():
    reductions = {
        "reduce": lambda run: len(run.telemetry),
        "row_fields": lambda case, runs: {"n": runs[0].data},
    }
    plan = make_plan(experiment(IDEAL, **reductions), 1)
    assert rows(plan, run_plan(plan))[0]["n"] == 200


def test_a_run_that_ends_early_is_told_unless_it_may():
    plan = make_plan(experiment(IDEAL, LOST), seeds=2)
    outcomes = run_plan(plan)
    assert unexpected_ends(plan, outcomes) == ["lost (left_workspace)"]
    assert [row["status"] for row in rows(plan, outcomes)] == ["completed", "left_workspace"]
    may = make_plan(experiment(allowed(LOST)), seeds=2)
    assert unexpected_ends(may, run_plan(may)) == []


def test_a_run_without_a_tick_has_no_numbers():
    names = ("max_abs_error_rad", "rms_error_rad", "tail_rms_error_rad")
    figures = {**dict.fromkeys(names), MEASURED: [np.nan] * 3, DATA: None}
    plan = make_plan(experiment(IDEAL), seeds=1)
    outcome = outcome_of(plan.experiment, RowResult("diverged", None, None, figures))
    for error in (outcome.max_abs_error, outcome.measured_max_abs_error, outcome.tail_rms_error):
        assert np.isnan(error).all()
    outcomes = plan.by_case([outcome])
    assert unexpected_ends(plan, outcomes) == ["ideal (diverged)"]
    assert rows(plan, outcomes)[0]["status"] == "diverged"
    run = simulate(scenarios.load("tilt", IDEAL.fields))
    none = SimpleNamespace(telemetry=run.telemetry.rows(0, 0))
    assert np.isnan(measured_max_abs_error(none)).all()


def test_a_law_or_a_reduction_that_fails_ends_the_experiment_in_one_line(tmp_path):
    law = tmp_path / "none.py"
    law.write_text("def step(t, reference, measurement, parameters, state, torque): torque[:] = float('nan')")
    none = IDEAL._replace(name="none", fields={**IDEAL.fields, "controller.law": f"{law}:step"})
    with pytest.raises(InputError, match=r"^reproduce short, none, seed 0: law step: expected a torque"):
        run_plan(make_plan(experiment(none), seeds=1))
    with pytest.raises(InputError, match=r"^reproduce short, ideal, seed 0: metric data: .*ZeroDivision"):
        run_plan(make_plan(experiment(IDEAL, reduce=lambda run: 1 / 0), seeds=1))


def test_a_case_that_cannot_be_run_is_bad_input():
    wrong = NOISY._replace(name="wrong", fields={"controller.law": "pdd"})
    with pytest.raises(InputError, match=r"controller\.law"):
        run_plan(make_plan(experiment(NOISY, wrong), seeds=3))
