"""What every experiment of the registry owes, whichever it is."""

import json

import pytest

from spheretwin import scenario as scenarios
from spheretwin.paper import EXPERIMENTS, page
from spheretwin.paper.page import Chapter, rows
from spheretwin.paper.runner import make_plan, run_plan, unexpected_ends


@pytest.mark.release("4 s, of which the cases of faults 3.4; content of the paper loads them")
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_can_be_loaded_and_its_cases_are_different(name):
    experiment = EXPERIMENTS[name]
    assert experiment.name == name
    cases = experiment.cases()
    assert len({case.name for case in cases}) == len(cases) > 0
    assert len({json.dumps([case.scenario, case.fields_of(0)]) for case in cases}) == len(cases)
    for case in cases:
        scenarios.load(case.scenario, case.fields)


@pytest.mark.release("4 s; content of the paper has rows and pages")
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_has_rows_and_a_page(name, tmp_path):
    plan = make_plan(EXPERIMENTS[name], seeds=1, limit=2)
    outcomes = run_plan(plan)
    assert unexpected_ends(plan, outcomes) == []
    json.dumps(rows(plan, outcomes), allow_nan=False)
    page.write(tmp_path, [Chapter(plan.experiment, plan.experiment.sections(outcomes))], "")
