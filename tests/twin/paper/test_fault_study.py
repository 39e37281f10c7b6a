"""A short fault study: its rows, its verdicts, its reasons, its page."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.supervision.fault_detector import LEAST_SHARE
from spheretwin.control.supervision.watchdog import Reason
from spheretwin.models.telemetry.status import Status
from spheretwin.paper import fault_cases, fault_latency, fault_sections, fault_study
from spheretwin.paper.experiment import Outcomes, RunOutcome
from spheretwin.paper.experiment_file import CaseRuns
from spheretwin.paper.fault_cases import (
    DETECTING,
    OF_GROUPS,
    OF_PARTS,
    REPORTED,
    FaultRuns,
    of_groups,
    of_part,
)
from spheretwin.paper.fault_outcomes import FaultData, RemainingTorque, reason, reduce, row_fields, tracks
from spheretwin.paper.page import rows
from spheretwin.paper.runner import make_plan, run_plan, scenario_of, unexpected_ends
from spheretwin.session import Session
from spheretwin.simulation import simulate
from spheretwin.study.statistics import interval

# Nine open groups that leave a tenth of the torque needed; a pair that does not track if it is not reported.
MANY, PAIR = (2, 3, 4, 9, 10, 11, 14, 15, 16), (0, 1)
DROPOUT = next(
    each for each in fault_cases.failures() if (each.part, each.mode) == ("encoder.gamma", "dropout")
)
MUJOCO = {"plant.engine": "mujoco"}


def on_mujoco(case):
    """Case on the engine whose loop with faults other tests need too."""
    return case._replace(fields={**case.fields, **MUJOCO})


def run_cases(cases, seeds):
    plan = make_plan(fault_study.EXPERIMENT._replace(cases=lambda: cases), seeds)
    return plan, run_plan(plan, threads=2)


@pytest.fixture(scope="module")
def study():
    cases = [
        fault_cases.HEALTHY,
        fault_cases.HEALTHY_ELECTRONICS,
        *(of_part(DROPOUT, way) for way in OF_PARTS),
    ]
    cases += [of_groups(groups, way) for groups in ((0,), PAIR, MANY) for way in OF_GROUPS]
    return run_cases([on_mujoco(case) for case in (*cases, fault_cases.shorted((0,), DETECTING))], seeds=2)


def row(study, case):
    return next(each for each in rows(*study) if each["case"] == case.name)


def outcome(ratio, status=Status.COMPLETED, **more_of_it):
    errors = {"after_rad": 0.01 * ratio, "healthy_rad": 0.01, "is_finite": True}
    ends = {"start_s": 1.0, "ended_s": 5.0, "stop_reason": Reason.NONE, "stopped_s": float("nan")}
    reported = {"is_reported": True, "least_norm": True, "remaining": None}
    detected = {"latencies_s": (), "driven_ticks": (), "false_detections": 0}
    data = FaultData(**{**errors, **ends, **reported, **detected, **more_of_it})
    return RunOutcome(status, {"max_abs_error_rad": [0.0] * 3}, np.zeros(3), data)


def test_the_error_without_a_failure_is_the_median_of_its_seeds():
    runs = [outcome(ratio) for ratio in (1.0, 2.0, 9.0)]
    text = fault_sections.parts_section(
        FaultRuns(Outcomes({fault_cases.HEALTHY_ELECTRONICS.name: runs}))
    ).text
    assert f"{np.degrees(0.02):.2f}°" in text
    assert f"{np.degrees(0.09):.2f}°" not in text


def test_every_run_ends_with_a_status_and_numbers(study):
    plan, outcomes = study
    assert unexpected_ends(plan, outcomes) == []
    assert all(run.data.is_finite for each in outcomes.values() for run in each)


def test_single_group_and_pair_track_where_told_or_found_and_else_not(study):
    for groups in ((0,), PAIR):
        for way in (REPORTED, DETECTING, fault_cases.BOUNDED):
            entry = row(study, of_groups(groups, way))
            assert (entry["tracks"], entry["reason"], entry["rank"]) == (2, None, 3)
            assert 0.9 < entry["error_ratio_range"][0] <= entry["error_ratio_range"][1] < 1.15
            assert entry["wrongly_found"] == 0
            are_found = [[time_s is not None for time_s in times] for times in entry["time_to_detection_s"]]
            assert are_found == [[way is DETECTING] * len(groups)] * 2
        untold = row(study, of_groups(groups, fault_cases.UNREPORTED))
        assert untold["tracks"] == 0
        assert "of the commanded torque is delivered" in untold["reason"]


def test_errors_are_those_of_the_healthy_run_with_the_same_seed(study):
    _, outcomes = study
    case = on_mujoco(of_groups(PAIR, fault_cases.UNREPORTED))
    for seed, run in enumerate(outcomes[case.name]):
        errors = [
            np.abs(simulate(scenarios.load("nutation", {**fields, "seed": seed})).telemetry["error_rad"])
            for fields in (case.fields_of(seed), {**fault_cases.BASE, **MUJOCO})
        ]
        first = round(run.data.start_s / 1e-3)
        assert case.seeded_fields(seed)["fault.0.start_s"] == pytest.approx(run.data.start_s)
        assert (run.data.after_rad, run.data.healthy_rad) == tuple(error[first:].max() for error in errors)
        np.testing.assert_array_equal(*(error[: first + 1] for error in errors))  # nothing has failed yet
        assert np.any(errors[0][first + 1 :] != errors[1][first + 1 :])
    for run in outcomes[fault_cases.HEALTHY.name]:
        assert (run.data.ratio, run.data.start_s) == (1.0, 0.0)


def test_the_reference_has_the_allocation_and_the_window_of_the_faulty_run(study):
    _, outcomes = study
    bounded = scenario_of(on_mujoco(of_groups(PAIR, fault_cases.BOUNDED)), None, 1)
    run = outcomes[of_groups(PAIR, fault_cases.BOUNDED).name][1]
    error = np.abs(simulate(bounded.model_copy(update={"fault": ()})).telemetry["error_rad"])
    assert run.data.healthy_rad == error[round(run.data.start_s / 1e-3) :].max()
    # It leaves the workspace before the end: the window of the reference ends there too.
    case = of_part(DROPOUT, fault_cases.ALONE)
    run = outcomes[case.name][0]
    assert run.status == Status.LEFT_WORKSPACE
    healthy = simulate(scenario_of(on_mujoco(fault_cases.HEALTHY_ELECTRONICS), None, 0)).telemetry[
        "error_rad"
    ]
    window = slice(round(run.data.start_s / 1e-3), round(run.data.ended_s / 1e-3))
    assert run.data.healthy_rad == np.abs(healthy[window]).max()


def opened(group, start_s, end_s=5.0, **changes):
    """One open group in the nutation of the study, with a detector."""
    fault = {"target": f"coil.{group:02d}", "mode": "open", "start_s": start_s, "detection": True}
    fields = {**fault_cases.BASE, **MUJOCO, "fault": [fault], "duration": end_s, **changes}
    return simulate(scenarios.load("nutation", fields))


def test_an_idle_group_is_not_detected_until_it_is_driven():
    """The longest time in which a group is commanded less than the threshold: a fault that starts there."""
    healthy = simulate(scenarios.load("nutation", {**fault_cases.BASE, **MUJOCO}))
    threshold_A = LEAST_SHARE * healthy.actuator.group.current_limit_A
    with Session(scenarios.load("nutation", {**fault_cases.BASE, "detector.detect": True})) as session:
        # What the study takes for the threshold of the detector.
        assert threshold_A == session._runtime._controller.data.supervision.detector.threshold_A
    idle = np.abs(healthy.telemetry["current_command_A"]) <= threshold_A
    length, end, group = max((*each, group) for group in range(18) for each in stretches(idle[:, group]))
    assert length >= 50
    begin = end - length
    # Cut off within the idle stretch it is not detected, and otherwise some ticks after it.
    missed = reduce(opened(group, 1e-3 * (begin + 2), 1e-3 * end))
    assert (missed.latencies_s, missed.driven_ticks) == ((None,), (0,))
    (latency_s,) = reduce(opened(group, 1e-3 * (begin + 2))).latencies_s
    assert latency_s > 1e-3 * (length - 2)


def stretches(true):
    """Length and end of every run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(int)))
    return [(end - begin, end) for begin, end in edges.reshape(-1, 2)]


def test_latency_is_a_distribution_in_which_the_undetected_count():
    runs = [
        outcome(1.0, latencies_s=(time_s,), driven_ticks=(5 if time_s else 1,), remaining=None)
        for time_s in [4e-3] * 80 + [5e-3] * 12 + [0.2] * 5 + [None] * 3
    ]
    undetected = outcome(0.9)
    names = [of_groups((0,), way).name for way in (DETECTING, REPORTED)]
    latency = fault_cases.of_latency((0,), "afsm_eso").name
    outcomes = {names[0]: runs, names[1]: [undetected] * len(runs), latency: runs}
    section = fault_latency.section(FaultRuns(Outcomes(outcomes)))
    (row,) = section.tables[0].rows
    # P(82 to 96 of 100 draws are below the quantile of 90 %) = 0.98; 88 to 99 for 95 %.
    assert row == (
        "one open, AFSM-ESO", "100", "4 [4, 4]", "5 [5, 200]", "200 [5, not detected]",
        "not detected [200, not detected]", "200", "3 (3.0 % [0.6, 8.5])", "5", "5", "1",
    )  # fmt: skip
    assert "Of the 3 that were not, 3 had fewer than 5" in section.text
    by_latency = {row[0]: row for row in section.tables[1].rows}
    assert {name: row[1] for name, row in by_latency.items()} == {
        "up to 6": "92", "above 100": "5", "not detected": "3", "all": "100",
    }  # fmt: skip
    # A tenth of a healthy error of 10 mrad, in every pair of runs.
    assert set(by_latency["all"][2:6]) == {
        "1.000 [1.000, 1.000]",
        "1.000 [1.000, –]",  # 100 draws
        "1.000",
    }


def test_groups_that_fail_at_once_are_one_draw():
    latencies = [4e-3] * 40 + [0.2] * 10
    several = [
        outcome(1.0, latencies_s=(time_s,) * count, driven_ticks=(5,) * count)
        for count in (2, 1)
        for time_s in latencies
    ]
    pair, single = (
        fault_latency.section(FaultRuns(Outcomes({name: runs}))).tables[0].rows[0]
        for name, runs in (
            (of_groups(PAIR, DETECTING).name, several[:50]),
            (fault_cases.of_latency((0,), "afsm").name, several[50:]),
        )
    )
    assert (pair[1], single[1]) == ("100", "50")
    assert pair[2:6] == single[2:6]


def test_too_little_torque_or_the_watchdog_is_the_reason(study):
    entry = row(study, of_groups(MANY, REPORTED))
    assert entry["tracks"] == 0
    assert entry["torque_left_over_needed"] < 0.5
    assert entry["least_norm_torque_over_needed"] <= entry["torque_left_over_needed"]
    assert entry["reason"].endswith("by least norm")
    released, alone = (row(study, of_part(DROPOUT, way)) for way in (fault_cases.RELEASE, fault_cases.ALONE))
    assert (released["reason"], released["status"]) == ("no fresh measurement", "failsafe")
    assert alone["status"] == "left_workspace"


def test_map_of_pairs_has_pairs_below_and_single_groups_on_the_diagonal(study):
    ratios = fault_sections.ratios(FaultRuns(study[1]), fault_cases.UNREPORTED)
    assert np.argwhere(np.isfinite(ratios)).tolist() == [[0, 0], [1, 0]]
    assert ratios[1, 0] == row(study, of_groups(PAIR, fault_cases.UNREPORTED))["error_ratio"]


def test_tracking_is_to_complete_and_to_stay_within_twice():
    lost = Status.LEFT_WORKSPACE
    runs = [outcome(2.0), outcome(2.001), outcome(1.0, lost), outcome(float("nan"), lost)]
    assert [tracks(run) for run in runs] == [True, False, False, False]


def test_a_lost_direction_is_the_first_reason(study):
    left = study[1][of_groups(PAIR, REPORTED).name][0].data.remaining
    assert reason(outcome(3.0, remaining=left._replace(rank=2))) == "rank 2"
    assert reason(outcome(1.5, remaining=left._replace(rank=2))) is None


def test_a_run_that_ends_before_the_fault_has_no_ratio():
    assert np.isnan(reduce(opened(0, 1.0, 0.5)).ratio)
    assert (
        json.loads(json.dumps(row_fields(fault_cases.HEALTHY, [outcome(float("nan"))]), allow_nan=False))[
            "error_ratio"
        ]
        is None
    )


def test_a_figure_parts_the_good_from_the_bad_with_the_fewest_errors():
    assert fault_study.split([2.0, 3.0, 5.0], [0.5, 1.0]) == (1.5, 1.0)
    assert fault_study.split([0.9, 2.0, 3.0, 4.0], [0.5, 1.0, 1.2]) == pytest.approx((1.6, 6 / 7))
    assert fault_study.split([1.0], []).rightly == 1.0


def test_shares_are_not_rounded_up_to_all():
    flags = {"99.9 %": [True] * 2000 + [False], "100 %": [True, True], "0.1 %": [False] * 2000 + [True]}
    assert [fault_sections.percent(each) for each in flags.values()] == list(flags)


def test_the_ten_smallest_sets_that_do_not_track_are_listed():
    shares = {"torque": 0.5, "least_norm": 0.4, "least_share": 0.3}
    remaining = RemainingTorque(**shares, singular_value_Nm_per_A=0.1, rank=3)
    runs = {tuple(range(size)): [outcome(100.0, remaining=remaining)] for size in range(14, 1, -1)}
    runs |= {(0,): [outcome(1.0, remaining=remaining)]}
    listed = fault_study.smallest([CaseRuns(of_groups(groups, REPORTED), runs[groups]) for groups in runs])
    assert [item["groups"] for item in listed] == [tuple(range(size)) for size in range(2, 12)]


PAGE = Path(__file__).parents[3] / "docs" / "explanation" / "faults.md"


def published(law):
    """Quantiles in ms of the page, 90 % and 95 %, each with its interval."""
    (row,) = (line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(f"| {law} |"))
    return np.array([list(map(float, re.findall(r"\d+", cell))) for cell in row.split("|")[3:5]])


@pytest.mark.release("runs 720 faults for a minute")
@pytest.mark.parametrize(("law", "label"), [("afsm", "AFSM"), ("afsm_eso", "AFSM-ESO")])
def test_a_tenth_of_the_draws_agrees_with_the_published_latencies(law, label):
    cases = [fault_cases.of_latency(groups, law) for groups in fault_cases.singles()]
    _, outcomes = run_cases(cases, seeds=20)
    latencies_s = [run.data.latencies_s[0] for case in cases for run in outcomes[case.name]]
    latencies_ms = [np.inf if latency_s is None else 1e3 * latency_s for latency_s in latencies_s]
    for share, (quantile, low, high) in zip((0.9, 0.95), published(label), strict=True):
        least, most = interval(latencies_ms, share)
        assert least <= quantile <= most
        assert most - least > high - low  # a tenth of the draws is less certain
