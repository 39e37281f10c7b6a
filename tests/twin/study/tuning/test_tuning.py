"""What a tuning finds, and that neither threads nor pruning take anything from it."""

import math

import pyarrow.parquet as parquet
import pytest

from spheretwin.control.laws.pid import PID
from spheretwin.study.grid import Grid
from spheretwin.study.optimise import dominates
from spheretwin.study.row import Rows
from spheretwin.study.runner import run
from spheretwin.study.tuning import gains
from spheretwin.study.tuning import trials as trial
from spheretwin.study.tuning.trials import Ended
from spheretwin.study.tuning.tuning import tune
from tests.twin.study.cases import study as swept_study
from tests.twin.study.cases import values as axis
from tests.twin.study.tuning.cases import TWO, gain, study

SAMPLERS = ("tpe", "nsga2", "random", "local")


def dominated(values, others):
    return any(dominates(other, values) for other in others)


def test_a_known_optimum_is_found(tmp_path):
    (law,) = tune(study(tmp_path), tmp_path, trials=60).laws
    (best,) = law.best
    # As near as the nearest of as many values that are spread evenly over the range must be, at the most.
    spacing = math.log(3000 / 30) / 60
    assert abs(math.log(best.finished.chosen["controller.stiffness"] / 300)) <= spacing / 2
    assert best.fields == best.finished.chosen
    assert best.finished.tried.values[0] == min(each.tried.values[0] for each in law.trials)


def test_to_be_large_is_the_other_way_round(tmp_path):
    down = tune(study(tmp_path), tmp_path / "down", trials=12).laws[0]
    up_study = study(tmp_path, objectives=[{"metric": "exact", "direction": "maximise"}])
    up = tune(up_study, tmp_path / "up", trials=12).laws[0]
    # The first ten are drawn alike whatever is looked for.
    chosen = [[each.chosen for each in law.trials][:8] for law in (up, down)]
    assert chosen[0] == chosen[1]
    assert up.best[0].finished.tried.values[0] == min(each.tried.values[0] for each in up.trials)
    assert up.trials[0].tried.values[0] == -down.trials[0].tried.values[0]
    written = parquet.read_table(tmp_path / "up" / "trials.parquet")["worst exact"].to_pylist()
    assert max(value for value in written if value is not None) == -up.best[0].finished.tried.values[0]


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_the_front_is_that_of_all_trials(tmp_path, sampler):
    (law,) = tune(study(tmp_path, **TWO, sampler=sampler, prune=False), tmp_path, trials=40).laws
    values = {each.number: each.tried.values for each in law.trials}
    assert len(values) == 40
    front = {each.finished.number for each in law.best}
    assert front == {number for number, each in values.items() if not dominated(each, values.values())}
    firsts = [each.finished.tried.values[0] for each in law.best]
    assert firsts == sorted(firsts)


@pytest.mark.parametrize("over", ["worst", "median"])
@pytest.mark.parametrize("objectives", [("miss",), ("miss", "slowness")], ids=len)
def test_pruning_loses_nothing(tmp_path, objectives, over):
    listed = [{"metric": each, "over": over} for each in objectives]
    noisy = study(tmp_path, listed, TWO["gains"], seeds=5)
    (law,) = tune(noisy, tmp_path, trials=40).laws
    pruned = [each for each in law.trials if each.tried.ended == Ended.PRUNED]
    assert len(pruned) > 5
    rows = Rows(gains.judged(noisy))
    conditions = list(Grid(rows.study))
    completed = [each.tried.values for each in law.trials if each.tried.ended == Ended.COMPLETED]
    for each in pruned:
        fields = gains.values(noisy.optimise.gain, each.chosen)
        objectives = noisy.optimise.objective
        (whole,) = trial.run_trials(rows, conditions, [fields], objectives, lambda _: False, lambda: False)
        assert len(each.tried.by_row) < len(whole.by_row) == 5
        assert whole.by_row[: len(each.tried.by_row)] == each.tried.by_row
        assert dominated(whole.values, completed)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_threads_do_not_show(tmp_path, sampler):
    noisy = study(tmp_path, **TWO, sampler=sampler)
    one, three = (tune(noisy, tmp_path / str(count), trials=30, threads=count) for count in (1, 3))
    assert one.table.read_bytes() == three.table.read_bytes()


def test_more_trials_are_the_same_and_some_more(tmp_path):
    noisy = study(tmp_path, **TWO)
    few, more = (tune(noisy, tmp_path, trials=trials).laws[0].trials for trials in (14, 28))
    once = tune(noisy, tmp_path / "once", trials=28).laws[0].trials
    assert more[:14] == few
    assert more == once


def test_the_first_trial_is_the_start_and_fresh_seeds_are_others(tmp_path):
    noisy = study(tmp_path, objectives=("miss",), gains=[gain(start=300.0)], seeds=2, fresh=50)
    (law,) = tune(noisy, tmp_path, trials=8).laws
    assert law.start.finished.number == 0
    assert law.start.finished.chosen == {"controller.stiffness": 300.0}
    # The start has no error but the noise, whose worst over 50 further seeds is another than over two.
    assert law.start.finished.tried.values == [max(each[0] for each in law.start.finished.tried.by_row)]
    assert law.start.holdout.values[0] > law.start.finished.tried.values[0]
    (best,) = law.best
    more = best.holdout.values[0] - law.start.holdout.values[0]
    # The same fresh seeds for both: what is between them is the gain alone, but for rounding.
    assert more == pytest.approx(abs(math.log(best.fields["controller.stiffness"] / 300)), abs=1e-12)


def test_the_start_is_what_a_sweep_of_the_study_gives(tmp_path):
    """Same rows, same seeds: at gains that are the law's own, the worst row of the sweep's table."""
    metric = "max_abs_error_rad"
    objective = {"metric": metric, "of": ["alpha", "beta"]}
    start = gain("damping", 50.0, 500.0, start=PID().damping[0])
    fields = {"duration": 0.05, "hardware": "electronics", "controller.law": "pid"}
    more = {"optimise": {"gain": [start], "objective": [objective]}, "seeds": 2, "fast": False}
    ours = swept_study(axis("plant.payload_kg", 0.0, 0.05), scenario="tilt", fields=fields, **more)
    (law,) = tune(ours, tmp_path, trials=1).laws
    swept = parquet.read_table(run(ours, tmp_path).table)[metric].to_pylist()
    assert [each[0] for each in law.start.finished.tried.by_row] == [max(of_row[:2]) for of_row in swept]
    assert law.start.finished.tried.values == [max(max(of_row[:2]) for of_row in swept)]
    assert len({tuple(of_row) for of_row in swept}) == 4


def test_a_lost_trial_has_its_reason(tmp_path):
    (law,) = tune(study(tmp_path, objectives=("nothing",)), tmp_path, trials=12).laws
    ends = {True: (Ended.LOST, "row 0: no nothing"), False: (Ended.COMPLETED, "")}
    lost = [each.chosen["controller.stiffness"] > 300 for each in law.trials]
    assert [(each.tried.ended, each.tried.reason) for each in law.trials] == [ends[each] for each in lost]
    assert set(lost) == {True, False}


def test_gains_that_make_no_scenario_lose(tmp_path):
    wide = study(tmp_path, gains=[gain(low=30.0, high=1e14)])
    (law,) = tune(wide, tmp_path, trials=8).laws
    lost = [each for each in law.trials if each.chosen["controller.stiffness"] > 1e9]
    assert lost == [each for each in law.trials if each.tried.ended == Ended.LOST]
    assert all(each.tried.reason.startswith("row 0: refused, scenario hold: ") for each in lost)
    assert 0 < len(lost) < 8


def test_where_every_trial_loses_there_is_no_best(tmp_path):
    never = study(tmp_path, objectives=("nothing",), gains=[gain(low=400.0)], fresh=2)
    (law,) = tune(never, tmp_path, trials=4).laws
    assert list(law.best) == []
    assert parquet.read_table(tmp_path / "trials.parquet")["ended"].to_pylist() == ["lost"] * 4
