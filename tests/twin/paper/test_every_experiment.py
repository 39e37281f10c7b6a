"""What every experiment of the registry owes, whichever it is."""

import json

import pytest

from spheretwin import scenario as scenarios
from spheretwin.paper import EXPERIMENTS, page
from spheretwin.paper.page import Chapter, rows
from spheretwin.paper.runner import make_plan, run_plan, unexpected_ends

FACE = {
    "figure", "case", "scenario", "controller", "m", "L", "hardware", "fields", "seeds", "status", "statuses",
    "paper", "max_abs_error_rad", "max_abs_error_range_rad", "measured_max_abs_error_rad",
    "measured_max_abs_error_range_rad", "tail_rms_error_rad", "tail_rms_error_range_rad", "rms_error_rad",
    "rms_error_range_rad", "rms_torque_Nm", "rms_torque_range_Nm", "current_variation_A_s",
    "current_variation_range_A_s", "plant", "command",
}  # fmt: skip


@pytest.mark.release("4 s, of which the cases of faults 3.4; content of the paper loads them")
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_can_be_loaded_and_its_cases_are_different(name):
    experiment = EXPERIMENTS[name]
    assert experiment.name == name
    assert experiment.title
    assert experiment.summary.endswith(".")
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
    entries = rows(plan, outcomes)
    json.dumps(entries, allow_nan=False)
    assert len(entries) == min(2, len(EXPERIMENTS[name].cases()))
    assert all(set(row) >= FACE for row in entries)
    sections = plan.experiment.sections(outcomes)
    assert all(
        len(row) == len(table.head) for section in sections for table in section.tables for row in table.rows
    )
    written = page.write(tmp_path, [Chapter(plan.experiment, sections)], "")
    markdown = written[0].read_text(encoding="utf-8")
    for figure in tmp_path.glob("*.svg"):
        assert f"({figure.name})" in markdown
