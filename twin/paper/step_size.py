"""Table of the error over the physics step, for every law and scenario, from 0.05 to 2 ms."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spheretwin.control.laws import HINGE_LAWS
from spheretwin.paper.experiment import Array, ExperimentSection, Outcomes, Statement
from spheretwin.paper.experiment_file import CaseRuns, ExperimentFile
from spheretwin.run import Run
from spheretwin.scenario.plant_sections import PlantSection
from spheretwin.viz.pages.markdown import ResultTable

FILE = ExperimentFile("step_size", law=[{"law": law} for law in HINGE_LAWS])

SAMPLE_s = 0.01
FINE_s = 1.25e-5
DEFAULT_s: float = PlantSection.model_fields["step_s"].default


class Trace(NamedTuple):
    """Motion of a run, sampled."""

    q_rad: Array  # (n, 3)
    ended_s: float


class StepCost(NamedTuple):
    """Difference of a run from that at the fine step."""

    difference_rad: float
    item: CaseRuns


def reduce(run: Run) -> Trace:
    """Sample the motion of a run."""
    table, every = run.telemetry, round(SAMPLE_s / run.scenario.controller.period_s)
    return Trace(table["q_rad"][::every].copy(), float(table["t_s"][-1]) if len(table) else 0.0)


Costs = dict[tuple[str, str, float], StepCost]
"""Differences by law, scenario and step in ms."""


def costs(outcomes: Outcomes) -> Costs:
    """Difference of each run; none if it or its fine one was not run."""
    items = FILE.runs(outcomes)
    fine = {_motion(item): item.runs[0] for item in items if item["step_s"] == FINE_s}
    of_steps = [item for item in items if item["step_s"] != FINE_s and _motion(item) in fine]
    every: Costs = {}
    for item in of_steps:
        coarse, reference = (run.data.q_rad for run in (item.runs[0], fine[_motion(item)]))
        if rows := min(len(coarse), len(reference)):
            cost = StepCost(float(np.max(np.abs(coarse[:rows] - reference[:rows]))), item)
            if np.isfinite(cost.difference_rad):
                every[item["law"], item["scenario"], item["ms"]] = cost
    return every


def _motion(item: CaseRuns) -> tuple[str, str, float]:
    return item["law"], item["scenario"], item["period_s"]


def sections(outcomes: Outcomes) -> list[ExperimentSection]:
    """Section with a table for each scenario."""
    every = costs(outcomes)
    tables = [_table(outcomes, every, motion["scenario"]) for motion in FILE["motion"]]
    return [FILE.section("steps", tables)]


def _table(outcomes: Outcomes, every: Costs, scenario: str) -> ResultTable:
    steps_ms = sorted(step["ms"] for step in FILE["step"] if step["step_s"] != FINE_s)
    items = FILE.runs(outcomes, scenario=scenario, step_s=DEFAULT_s)
    errors = {item["law"]: f"{1e3 * np.max(item.runs[0].max_abs_error):.3g}" for item in items}
    rows = [
        (law, *(_cell(every.get((law, scenario, ms))) for ms in steps_ms), errors.get(law, "not run"))
        for law in HINGE_LAWS
    ]
    head = ("law", *(f"{ms:g} ms" for ms in steps_ms), f"tracking error at {1e3 * DEFAULT_s:g} ms")
    return ResultTable(f"Difference in mrad: {scenario}", head, rows)


def findings(outcomes: Outcomes) -> list[Statement]:
    """Largest difference at the default step and at twice that step, in runs that complete."""
    complete = [cost for cost in costs(outcomes).values() if cost.item.runs[0].is_complete]
    largest = []
    for step_s in (DEFAULT_s, 2 * DEFAULT_s):
        of_step = [cost for cost in complete if cost.item["step_s"] == step_s]
        if not of_step:
            return []
        largest.append(max(of_step, key=lambda cost: cost.difference_rad))
    texts = (
        f"{1e3 * cost.difference_rad:.2g} mrad at {cost.item['ms']:g} ms ({cost.item['law']} in"
        f" {cost.item['scenario']})"
        for cost in largest
    )
    return [Statement(None, f"the physics step changes a motion by at most {' and '.join(texts)}")]


def _cell(cost: StepCost | None) -> str:
    if cost is None:
        return "not run"
    run = cost.item.runs[0]
    end = "" if run.is_complete else f" (left at {run.data.ended_s:.2f} s)"
    return f"{1e3 * cost.difference_rad:.2g}{end}"


EXPERIMENT = FILE.experiment(sections=sections, reduce=reduce, findings=findings)
