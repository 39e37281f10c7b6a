"""Requirements on every experiment of the registry: cases that can be loaded and run."""

import json

import pytest

from spheretwin import scenario as scenarios
from spheretwin.paper import EXPERIMENTS
from spheretwin.paper.page import rows
from spheretwin.paper.runner import make_plan, run_plan, unexpected_ends


@pytest.mark.release("4 s, of which the cases of faults 3.4; content of the paper loads them")
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_cases_can_be_loaded_and_are_different(name):
    experiment = EXPERIMENTS[name]
    assert experiment.name == name
    cases = experiment.cases()
    assert len({case.name for case in cases}) == len(cases) > 0
    assert len({json.dumps([case.scenario, case.fields_of(0)]) for case in cases}) == len(cases)
    for case in cases:
        scenarios.load(case.scenario, case.fields)


@pytest.mark.release("4 s; content of the paper has rows of constructed runs")
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_the_first_cases_end_as_expected_and_have_rows(name):
    plan = make_plan(EXPERIMENTS[name], seeds=1, limit=2)
    outcomes = run_plan(plan)
    assert unexpected_ends(plan, outcomes) == []
    entries = rows(plan, outcomes)
    json.dumps(entries, allow_nan=False)
    assert len(entries) == min(2, len(EXPERIMENTS[name].cases()))
    for section in plan.experiment.sections(outcomes):
        assert all(len(row) == len(table.head) for table in section.tables for row in table.rows)
