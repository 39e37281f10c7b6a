"""Table of the error over the physics step, for every law and scenario, from 0.05 to 2 ms."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spheretwin.control.laws import LAWS
from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import Array, Case, Experiment, Finding, Outcomes, ResultTable, Section
from spheretwin.run import Run
from spheretwin.scenario.plant_sections import PlantSection

SCENARIOS = ("sinusoid", "nutation", "tilt", "hold")
SAMPLE_s = 0.01
FINE_s = 1.25e-5
DEFAULT_s: float = PlantSection.model_fields["step_s"].default

EXPECTED = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.DIVERGED)

METHOD = (
    "Largest difference of any hinge angle, in mrad, between a run and the same run with a physics step of"
    f" {1e3 * FINE_s:g} ms, compared every {1e3 * SAMPLE_s:g} ms; one seed, the law's default gains. A"
    " physics step cannot be longer than the control period: at 2 ms the control period is 2 ms too, in both"
    " runs, so that the law is another one there. The last column is the largest tracking error at"
    f" {1e3 * DEFAULT_s:g} ms, for comparison. *Left at* is the time at which a run left the workspace; the"
    " difference is then taken up to there."
)


class Step(NamedTuple):
    """A physics step, and the control period that it is compared at."""

    step_s: float
    period_s: float


class Trace(NamedTuple):
    """Motion of a run, sampled."""

    q_rad: Array  # (n, 3)
    ended_s: float


class Cost(NamedTuple):
    """Difference of a run from that at the fine step."""

    difference_rad: float
    step_s: float
    law: str
    scenario: str


STEPS = tuple(Step(step_s, 1e-3) for step_s in (5e-5, 1e-4, 2.5e-4, 5e-4, 1e-3))
LONGEST = Step(2e-3, 2e-3)


def cases() -> list[Case]:
    """Cases of every law in every scenario at every step; the default step first."""
    by_default = sorted((*STEPS, LONGEST), key=lambda step: step.step_s != DEFAULT_s)
    every = [
        case(law, scenario, shorter)
        for scenario in SCENARIOS
        for law in LAWS
        for step in by_default
        for shorter in (step, fine(step))
    ]
    return list({case.name: case for case in every}.values())


def fine(step: Step) -> Step:
    """Fine step that is the reference of a step."""
    return Step(FINE_s, step.period_s)


def case(law: str, scenario: str, step: Step) -> Case:
    """Case of a law in a scenario at a step."""
    return Case(
        name=f"{law}, {scenario}: {1e3 * step.step_s:g} ms, control {1e3 * step.period_s:g} ms",
        scenario=scenario,
        fields={
            "controller.law": law,
            "controller.period_s": step.period_s,
            "plant.step_s": step.step_s,
        },
        details={"step_s": step.step_s, "period_s": step.period_s},
        single_run=True,
        expected_statuses=EXPECTED,
    )


def reduce(run: Run) -> Trace:
    """Sample the motion of a run."""
    table = run.telemetry
    every = round(SAMPLE_s / run.scenario.controller.period_s)
    return Trace(table["q_rad"][::every].copy(), float(table["t_s"][-1]) if len(table) else 0.0)


def difference_rad(outcomes: Outcomes, law: str, scenario: str, step: Step) -> float:
    """Largest difference of any hinge angle from the run at the fine step; NaN if either was not run."""
    runs = [run for length in (step, fine(step)) for run in outcomes.runs(case(law, scenario, length))]
    if len(runs) < 2:
        return float("nan")
    coarse, reference = (run.data.q_rad for run in runs)
    rows = min(len(coarse), len(reference))
    return float(np.max(np.abs(coarse[:rows] - reference[:rows]))) if rows else float("nan")


def sections(outcomes: Outcomes) -> list[Section]:
    """Sections with a table for each scenario."""
    return [
        Section("Error over the physics step", METHOD, [_table(outcomes, scenario) for scenario in SCENARIOS])
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Largest difference at the default step and at twice that step, in runs that complete."""
    steps = [step for step in STEPS if step.step_s in (DEFAULT_s, 2 * DEFAULT_s)]
    costs = [cost for step in steps if (cost := _largest(outcomes, step))]
    if len(costs) < len(steps):
        return []
    texts = [
        f"{1e3 * cost.difference_rad:.2g} mrad at {1e3 * cost.step_s:g} ms ({cost.law} in {cost.scenario})"
        for cost in costs
    ]
    return [Finding(None, f"the physics step changes a motion by at most {' and '.join(texts)}")]


def _largest(outcomes: Outcomes, step: Step) -> Cost | None:
    costs = [
        Cost(difference_rad(outcomes, law, scenario, step), step.step_s, law, scenario)
        for law in LAWS
        for scenario in SCENARIOS
        if (runs := outcomes.runs(case(law, scenario, step))) and runs[0].is_complete
    ]
    return max((cost for cost in costs if np.isfinite(cost.difference_rad)), default=None)


def _table(outcomes: Outcomes, scenario: str) -> ResultTable:
    head = [f"{1e3 * step.step_s:g} ms" for step in (*STEPS, LONGEST)]
    return ResultTable(
        f"Difference in mrad: {scenario}",
        ("law", *head, f"tracking error at {1e3 * DEFAULT_s:g} ms"),
        [_row(outcomes, law, scenario) for law in LAWS],
    )


def _row(outcomes: Outcomes, law: str, scenario: str) -> tuple[str, ...]:
    cells = [_cell(outcomes, law, scenario, step) for step in (*STEPS, LONGEST)]
    runs = outcomes.runs(case(law, scenario, Step(DEFAULT_s, STEPS[0].period_s)))
    error = f"{1e3 * np.max(runs[0].max_abs_error):.3g}" if runs else "not run"
    return (law, *cells, error)


def _cell(outcomes: Outcomes, law: str, scenario: str, step: Step) -> str:
    difference = difference_rad(outcomes, law, scenario, step)
    if not np.isfinite(difference):
        return "not run"
    run = outcomes.runs(case(law, scenario, step))[0]
    end = "" if run.is_complete else f" (left at {run.data.ended_s:.2f} s)"
    return f"{1e3 * difference:.2g}{end}"


EXPERIMENT = Experiment(
    name="step_size",
    title="Error over the physics step",
    summary="Every law in every scenario at physics steps from 0.05 to 2 ms, compared with 0.0125 ms.",
    cases=cases,
    sections=sections,
    reduce=reduce,
    findings=findings,
)
