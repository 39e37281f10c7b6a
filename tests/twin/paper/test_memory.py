"""What was run is remembered by all that it depends on, and by nothing else."""

from unittest.mock import Mock

import numpy as np
import pytest

from spheretwin.control.supervision.watchdog import Reason
from spheretwin.metrics.user_metrics import own_value
from spheretwin.models.telemetry.status import Status
from spheretwin.paper import earlier_runs, fault_outcomes, nutation, runner, stability, step_size, tilt
from spheretwin.paper.earlier_runs import key_of
from spheretwin.paper.page import rows
from spheretwin.paper.runner import (
    make_plan,
    outcome_of,
    run_plan,
    scenario_of,
    summarise,
)
from spheretwin.study.row import RowResult, Rows
from tests.twin.paper.cases import IDEAL, NOISY, SHORT, experiment


@pytest.fixture
def ran(monkeypatch, tmp_path):
    """Scenarios that were really run, with a cache folder of their own."""
    real, results = Rows.run, []
    monkeypatch.setattr(earlier_runs, "cache_folder", lambda: tmp_path)

    def run(self, rows, engine):
        results.extend(self.scenario(row, engine) for row in rows)
        return real(self, rows, engine)

    monkeypatch.setattr(Rows, "run", run)
    return results


def errors(run) -> nutation.Array:
    return run.telemetry["error_rad"].copy()


def run_cached(plan, **options):
    with runner.earlier_runs(plan, summarise(plan)) as earlier:
        return run_plan(plan, earlier=earlier, **options)


def test_rows_that_were_run_are_not_run_again_and_are_the_same(ran):
    made = experiment(NOISY, IDEAL, reduce=errors)
    plan = make_plan(made, seeds=3)
    first = run_cached(plan)
    assert len(ran) == 4
    again = run_cached(plan)
    assert len(ran) == 4
    assert rows(plan, again) == rows(plan, first)
    for name in first:
        np.testing.assert_array_equal(*([run.data for run in runs[name]] for runs in (first, again)))
    run_cached(make_plan(made, seeds=5))
    assert sorted(scenario.seed for scenario in ran[4:]) == [3, 4]  # threads begin in any order


SPAN = stability.Span(1e-3, 0.1, 2 / 3, float("nan"))
FAULT = fault_outcomes.FaultData(
    0.0, 1e-300, 0.1 + 0.2, 1.0, True, Reason.CURRENT, float("nan"), False, True,
    fault_outcomes.RemainingTorque(1.0, 0.5, 0.25, 1 / 3, 3), (None, 0.02), (5, 0), 0,
)  # fmt: skip


@pytest.mark.parametrize(
    ("reduce", "data"),
    [
        (fault_outcomes.reduce, FAULT),
        (fault_outcomes.reduce, FAULT._replace(remaining=None, latencies_s=(), driven_ticks=())),
        (stability.reduce, stability.StabilityMeasures(0.5, SPAN, None, (1.0, 2.0), None)),
        (
            stability.reduce,
            stability.StabilityMeasures(None, None, None, None, None, np.array([[1.0, -0.0], [2.0, 1 / 3]])),
        ),
        (nutation.reduce, nutation.NutationData(np.zeros(0), None)),
        (
            nutation.reduce,
            nutation.NutationData(
                np.array([[0.1, np.nan, np.inf]]),
                nutation.Trajectory(np.arange(2.0), np.eye(3)[:2], np.ones((2, 3)) / 3, np.zeros(2)),
            ),
        ),
        (step_size.reduce, step_size.Trace(np.ones((2, 3)), 1.0)),
        (tilt.reduce, np.ones((4, 2)) / 7),
    ],
)
def test_the_data_of_a_run_are_the_same_from_plain_text(reduce, data):
    figures = {"rms_error_rad": [1 / 3] * 3, runner.MEASURED: [0.1, np.nan, 1.0]}
    result = RowResult(
        "left_workspace",
        None,
        None,
        {**figures, runner.DATA: own_value("data", Mock(return_value=data), None)},
    )
    outcome = outcome_of(experiment(IDEAL, reduce=reduce), result)
    assert repr(outcome.data) == repr(data)  # also the types, and each digit
    assert outcome.status is Status.LEFT_WORKSPACE
    assert outcome.figures == {"rms_error_rad": [1 / 3] * 3}
    np.testing.assert_array_equal(outcome.measured_max_abs_error, [0.1, np.nan, 1.0])


def test_without_a_journal_everything_runs(ran):
    plan = make_plan(experiment(NOISY), seeds=2)
    with runner.earlier_runs(plan, summarise(plan)) as earlier:
        run_plan(plan, earlier=earlier)
        run_cached(plan)  # as in another process, which cannot write the journal
    assert len(ran) == 4
    run_cached(plan)
    assert len(ran) == 4


def test_what_was_run_before_an_interruption_is_kept(ran):
    plan = make_plan(experiment(NOISY), seeds=4)
    with pytest.raises(KeyboardInterrupt):
        run_cached(plan, done=Mock(side_effect=[None, KeyboardInterrupt]), threads=1)
    before = len(ran)
    run_cached(plan)
    assert len(ran) - before <= 2


def test_a_key_is_of_every_field_but_plant_and_seed():
    def key(case=IDEAL, plant=None, seed=0, **fields):
        return key_of(scenario_of(case._replace(fields={**case.fields, **fields}), plant, seed))

    assert key() == key(seed=5) == key(**{"plant.engine": "mujoco"})
    others = [key(NOISY), key(**{"disturbance.load": 1e-9}), key(**{"controller.law": "pd"})]
    assert len({key(), *others}) == 4


def test_a_law_of_the_user_s_is_known_by_what_is_in_its_file(tmp_path):
    law = tmp_path / "lazy.py"
    case = IDEAL._replace(fields={**SHORT, "controller.law": f"{law}:step"})
    keys = set()
    for value in (0.0, 1e-3):
        law.write_text(f"def step(t, reference, measurement, parameters, state, torque): torque[:] = {value}")
        keys.add(key_of(scenario_of(case, None)))
    assert len(keys) == 2


def test_either_plant_is_remembered_for_itself(ran):
    case = NOISY._replace(fields={"duration": 0.05})
    for plant in ("mujoco", "lagrangian", "mujoco"):
        run_cached(make_plan(experiment(case), seeds=1, plant=plant))
    assert [scenario.plant.engine for scenario in ran] == ["mujoco", "lagrangian"]
