"""Approved content of the pages of the paper's experiments: real reductions of constructed runs."""

from collections.abc import Sequence
from functools import partial
from unittest.mock import patch

import pytest

from spheretwin.paper import EXPERIMENTS, page, runner
from spheretwin.paper.experiment import Case, Experiment
from spheretwin.paper.page import chapter_of, rows
from spheretwin.paper.runner import Plan, PlanResult
from tests.content.content import Cases, check, scratch
from tests.content.pages import folder_text
from tests.content.runs import made_run
from tests.content.values import tree

MOST_ROWS = 3
"""Rows of the JSON in the text; all of them have the same keys."""

SEEDS = {"figure8": 2, "figure11": 2}

EVERY = {"figure7": 2, "stability": 3, "faults": 120, "step_size": 8}
"""One case in so many, where an experiment has hundreds."""

MOST_TICKS = {"stability": 300, "faults": 10_000}
"""Rows of a run, however long its scenario is: 1500 unless given."""

LAWS = {"rivals": ("afsm_eso", "pid", "pd"), "budget": ("afsm", "pd")}
"""Laws of experiments whose tables need all conditions of a law."""


def _cases(experiment: Experiment) -> Sequence[Case]:
    laws = LAWS.get(experiment.name)
    cases = [case for case in experiment.cases() if not laws or case.fields.get("controller.law") in laws]
    return cases[:: EVERY.get(experiment.name, 1)]


def chapter(name: str) -> str:
    """Return page, figures and rows of an experiment."""
    experiment = EXPERIMENTS[name]
    plan = Plan(experiment, list(_cases(experiment)), SEEDS.get(name, 1))
    outcomes = []
    for job in plan.jobs:
        made = partial(made_run, name=job.name, most_ticks=MOST_TICKS.get(name, 1500))
        with patch.object(runner, "simulate", made):
            outcomes.append(runner._outcome(experiment, job))
    result = PlanResult(plan, runner.summarise(plan), plan.by_case(outcomes), [1e-9, 3e-9])
    of_json = rows(plan, result.outcomes, result.summaries)
    written = folder_text(
        lambda folder: page.write(folder, [chapter_of(result, of_json)], f"spheretwin reproduce {name}"),
        scratch(f"paper_{name}"),
    )
    step = max(1, len(of_json) // MOST_ROWS)
    return "\n".join([written, f"=== {len(of_json)} rows", *tree(of_json[::step])])


CASES: Cases = {f"paper_{name}": partial(chapter, name) for name in EXPERIMENTS}


@pytest.mark.parametrize("name", CASES)
def test_content(name):
    check(name, CASES)
