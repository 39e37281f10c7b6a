"""The cases of the fault study: every set and mode that it promises, and some of each kind under a limit."""

from collections import Counter
from itertools import combinations

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.faults.targets import TARGETS
from spheretwin.paper import fault_cases, fault_study
from spheretwin.paper.fault_cases import DETECTING, OF_GROUPS, OF_PARTS, failures, of_groups, of_part
from spheretwin.paper.runner import Plan

ALL = fault_cases.cases()


def test_every_group_and_pair_is_there():
    assert list(fault_cases.singles()) == [(group,) for group in range(18)]
    assert list(fault_cases.pairs()) == list(combinations(range(18), 2))


def test_drawn_sets_are_even_in_size_and_groups_all_different_and_the_same_each_time():
    drawn = fault_cases.random_groups()
    assert len(drawn) == len(set(drawn)) == 2000
    sizes = Counter(map(len, drawn))
    assert set(sizes) == set(range(3, 10))
    assert max(sizes.values()) - min(sizes.values()) <= 1
    assert all(list(groups) == sorted(set(groups)) and groups[0] >= 0 and groups[-1] < 18 for groups in drawn)
    fault_cases.random_groups.cache_clear()
    assert fault_cases.random_groups() == drawn
    counted = Counter(group for groups in drawn for group in groups)
    # Each group is in a third of the sets, but for six standard deviations of 2,000 coins.
    assert all(abs(counted[group] - 2000 / 3) < 6 * (2000 * 2 / 9) ** 0.5 for group in range(18))


def test_every_set_has_its_ways_and_a_sample_runs_on_the_other_engine():
    kinds = Counter(case.details["kind"] for case in ALL)
    ways = len(OF_GROUPS)
    assert kinds == {
        "healthy": 2,
        "single": 18 * ways,
        "pair": 153 * ways,
        "drawn": 2000 * ways,
        "part": len(failures()) * len(OF_PARTS),
        "short": 18,
        "latency": 2 * 18,
        "MuJoCo": len(fault_cases.sample()) * ways,
    }
    assert len(fault_cases.sample()) == -(-2171 // fault_cases.SAMPLE)


def test_ways_change_nothing_but_what_they_say():
    loaded = {
        way.name: scenarios.load("nutation", of_groups((3, 11), way).fields).model_dump() for way in OF_GROUPS
    }
    base = loaded[fault_cases.UNREPORTED.name]
    assert (base["plant"]["modelling_error"], base["disturbance"]["load"]) == (0.2, 1.0)
    assert [fault["target"] for fault in base["fault"]] == ["coil.03", "coil.11"]
    for way, field in ((fault_cases.REPORTED, "reported_to_controller"), (DETECTING, "detection")):
        changed = tuple({**fault, field: True} for fault in base["fault"])
        assert loaded[way.name] == {**base, "fault": changed}
    assert loaded[fault_cases.BOUNDED.name] == {**loaded[fault_cases.REPORTED.name], "allocation": "bounded"}


def test_every_mode_of_every_shared_part_is_there_with_a_value_where_it_needs_one():
    there = {(failure.part, failure.mode) for failure in failures()}
    wanted = {
        (part, mode)
        for target in TARGETS.values()
        if not target.each_group
        for part in target.names(18)
        for mode in target.modes
    }
    assert there == wanted
    assert {kind for kind, _ in fault_cases.VALUES} <= set(TARGETS)
    for failure in failures():
        for way in OF_PARTS:
            scenario = scenarios.load("nutation", of_part(failure, way).fields)  # refuses what lacks a value
            assert scenario.hardware == "electronics"
            assert scenario.fault[0].target == failure.part


@pytest.mark.parametrize("limit", [25, 60])
def test_a_limit_leaves_some_of_each_kind(limit):
    kinds = Counter(case.details["kind"] for case in ALL[:limit])
    assert set(kinds) == {"healthy", "single", "pair", "drawn", "part", "short", "latency", "MuJoCo"}
    named = {case.name for case in ALL[:limit]}
    assert named & {name.removesuffix(", MuJoCo") for name in named if name.endswith(", MuJoCo")}


def test_starts_are_spread_evenly_over_the_whole_run():
    """No tick is left out, and none is more likely: the fifths of the run have a fifth of the starts each."""
    run = scenarios.load(fault_cases.SCENARIO)
    starts = np.array([fault_cases.start_s(f"set {name}", seed) for name in range(200) for seed in range(20)])
    ticks = starts / run.controller.period_s
    np.testing.assert_allclose(ticks, np.round(ticks), atol=1e-6)
    assert 0.0 <= starts.min() < 0.01
    assert run.duration - 0.01 < starts.max() <= run.duration - run.controller.period_s
    counted, _ = np.histogram(starts, 5, (0.0, run.duration))
    # Each fifth has 800 of 4,000 draws, but for six standard deviations.
    assert np.all(np.abs(counted - 800) < 6 * (4000 * 0.2 * 0.8) ** 0.5)


def test_all_ways_and_engines_of_a_set_share_the_start_of_a_seed_and_other_seeds_have_others():
    def starts(case, seed):
        faults = scenarios.load(fault_cases.SCENARIO, {**case.fields_of(seed), "seed": seed}).fault
        return {fault.start_s for fault in faults}

    for groups in ((3,), (3, 11), (1, 4, 7, 9)):
        both = [make(groups, way) for make in (of_groups, fault_cases.on_other_engine) for way in OF_GROUPS]
        drawn = [[starts(case, seed) for case in both] for seed in range(5)]
        assert all(one == of_seed[0] and len(one) == 1 for of_seed in drawn for one in of_seed)
        assert len({one for of_seed in drawn for one in of_seed[0]}) == 5
    for failure in failures()[:3]:
        assert len(set.union(*(starts(of_part(failure, way), 0) for way in OF_PARTS))) == 1
    (alone,) = starts(fault_cases.shorted((3,), DETECTING), 1)
    assert alone == fault_cases.start_s("group 3", 1)


def test_the_latency_is_that_of_two_laws_over_many_starts():
    of_latency = [case for case in ALL if case.details["kind"] == "latency"]
    laws = Counter(scenarios.load("nutation", case.fields).controller.law for case in of_latency)
    assert laws == {"afsm": 18, "afsm_eso": 18}
    assert {case.seeds for case in of_latency} == {fault_cases.SEEDS}
    jobs = Plan(fault_study.EXPERIMENT, of_latency).jobs
    assert len(jobs) == 36 * fault_cases.SEEDS >= 2 * 3600
    assert len(Plan(fault_study.EXPERIMENT, of_latency, 2).jobs) == 72
    # Starts and seeds of AFSM are those of the other tables.
    (other,) = (case for case in ALL if case.name == of_groups((0,), DETECTING).name)
    assert of_latency[0].fields_of(3) == {**other.fields_of(3), "controller.law": "afsm"}


def test_only_what_is_drawn_or_a_sample_runs_once():
    assert {case.details["kind"] for case in ALL if case.single_run} == {"drawn", "MuJoCo"}
    assert all(case.is_random for case in ALL)  # the disturbance depends on the seed
