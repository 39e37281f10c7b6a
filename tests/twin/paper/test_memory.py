"""What was run is remembered by all that it depends on, and by nothing else."""

from unittest.mock import Mock

import numpy as np
import pytest

from spheretwin.paper import runner
from spheretwin.paper.page import rows
from spheretwin.paper.runner import OutcomeCache, key_of, make_plan, run_plan, scenario_of, summarise
from tests.twin.paper.cases import IDEAL, NOISY, SHORT, experiment


@pytest.fixture
def ran(monkeypatch):
    """Scenarios that were really run, with a cache of their own, in memory."""
    real, results, entries = runner.run_session, [], {}
    monkeypatch.setattr(runner, "load_entry", entries.get)
    monkeypatch.setattr(runner, "store_entry", entries.__setitem__)

    def run_session(session):
        results.append(session.initial_scenario)
        return real(session)

    monkeypatch.setattr(runner, "run_session", run_session)
    return results


def run_cached(plan, **options):
    return run_plan(plan, cache=OutcomeCache(plan, summarise(plan)), **options)


def test_rows_that_were_run_are_not_run_again_and_are_the_same(ran):
    made = experiment(NOISY, IDEAL, reduce=lambda run: run.telemetry["error_rad"].copy())
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
