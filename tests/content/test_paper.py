"""Approved content of the pages of the paper's experiments: real reductions of constructed runs."""

import zlib
from collections.abc import Sequence
from functools import partial
from unittest.mock import patch

import numpy as np

from spheretwin.control.estimators import noise_and_lag
from spheretwin.paper import EXPERIMENTS, page, runner
from spheretwin.paper.experiment import Case, Experiment
from spheretwin.paper.page import chapter_of, rows
from spheretwin.paper.runner import Plan, PlanResult
from spheretwin.run import figures_of
from spheretwin.study.row import RowResult
from tests.content.content import Cases, content_test, scratch
from tests.content.pages import folder_text
from tests.content.runs import made_run
from tests.content.values import tree

MOST_ROWS = 3
"""Rows of the JSON in the text; all of them have the same keys."""

SEEDS = {"stability": 1, "faults": 1, "step_size": 1, "rivals": 6}
"""Runs of a case: 3 unless given, so that a median is neither of its bounds; 6 give it an interval."""

EVERY = {"figure6": 3, "figure7": 4, "stability": 6, "faults": 109, "step_size": 8}
"""One case in so many, where an experiment has hundreds."""

MOST_TICKS = {"stability": 200, "faults": 10_000}
"""Rows of a run, however long its scenario is: 1500 unless given."""

LAWS = {"rivals": ("afsm_eso", "pid"), "budget": ("afsm",)}
"""Laws of experiments whose tables need all conditions of a law."""


def _cases(experiment: Experiment) -> Sequence[Case]:
    laws = LAWS.get(experiment.name)
    cases = [case for case in experiment.cases() if not laws or case.fields.get("controller.law") in laws]
    if experiment.name == "rivals":  # some limits without a run of a law
        cases = [case for case in cases if zlib.crc32(case.name.encode()) % 9]
    return cases[:: EVERY.get(experiment.name, 1)]


def chapter(name: str) -> str:
    """Return page, figures and rows of an experiment."""
    experiment = EXPERIMENTS[name]
    return _text(experiment, _cases(experiment), SEEDS.get(name, 3))


def limited(name: str) -> str:
    """Return the page of a few cases of an experiment: nothing is stated of what was not run."""
    experiment = EXPERIMENTS[name]
    cases = experiment.cases()
    text = _text(experiment, cases[2 :: max(1, len(cases) // 4)][:4], 1)
    return text.partition("=== reproduce.md\n")[2].partition("\n=== ")[0]


def made_comparison(bandwidths_rad_s):
    """Return constructed curves: those of the differentiator depend on the rounding of the processor."""
    bandwidth, curves = np.array(bandwidths_rad_s), {}
    for number, kind in enumerate(("difference", "kalman", "differentiator"), 1):
        rms, lag_s = 1e-3 * number * np.sqrt(bandwidth), (2.5 - number) / bandwidth
        curves[kind] = noise_and_lag.EstimatorComparison(
            rms, lag_s, 1e-3 / number / bandwidth + 1e-6 * number, 1.1 * rms, 0.9 * lag_s, 200.0 * number
        )
    return curves


def _text(experiment: Experiment, cases: Sequence[Case], seeds: int) -> str:
    name = experiment.name
    plan = Plan(experiment, list(cases), seeds)
    outcomes = []
    for job in plan.jobs:
        scenario = runner.scenario_of(job.case, job.plant, job.seed)
        run = made_run(scenario, name=job.name, most_ticks=MOST_TICKS.get(name, 1500))
        figures = figures_of(run, runner.figures_of(experiment))
        outcomes.append(runner.outcome_of(experiment, RowResult(str(run.status), None, None, figures)))
    result = PlanResult(plan, runner.summarise(plan), plan.by_case(outcomes), [1e-9, 3e-9])
    of_json = rows(plan, result.outcomes, result.summaries)
    with patch.object(noise_and_lag, "compare", made_comparison):
        written = folder_text(
            lambda folder: page.write(folder, [chapter_of(result, of_json)], f"spheretwin reproduce {name}"),
            scratch(f"paper_{name}_{len(cases)}"),
        )
    step = max(1, len(of_json) // MOST_ROWS)
    return "\n".join([written, f"=== {len(of_json)} rows", *tree(of_json[::step])])


CASES: Cases = {f"paper_{name}": partial(chapter, name) for name in EXPERIMENTS}
CASES |= {f"paper_{name}_limited": partial(limited, name) for name in EXPERIMENTS}


RELEASE = {
    "paper_faults": "7 s; paper_faults_limited has the same page of fewer cases",
    "paper_rivals": "1.3 s; paper_rivals_limited has the same page of fewer cases",
    "paper_figure6": "1.2 s; figure 7 and figure 6_limited have the same page of other cases",
}


test_content = content_test(CASES, RELEASE)
