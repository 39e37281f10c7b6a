"""Workflow on a hidden machine: its results, its page and the command ``reproduce twin``."""

import json
import re

import pytest

from spheretwin import cli
from spheretwin.machine import DesignSettings, workflow, workflow_page
from spheretwin.machine.workflow import PAYLOADS_kg, WorkflowSettings, run_workflow

QUICK = WorkflowSettings(
    seed=3,
    design=DesignSettings(duration_s=1.0, candidates=2, sines=2, payloads_kg=PAYLOADS_kg),
    judged_s=2.0,
)
SHORT = {"design"}
"""Checks that two candidates of one second need not pass."""


@pytest.fixture(scope="module")
def result():
    return run_workflow(QUICK)


def broken(result):
    return {check.name for check in workflow_page.checks_of(result) if not check.ok} - SHORT


WHOLE = pytest.mark.release("the whole workflow for 7 s; each of its verbs has tests")


@WHOLE
def test_the_hidden_machine_is_found_followed_and_watched(result):
    """With an experiment of a second: the intervals are wider, and hold the true values all the same."""
    assert broken(result) == set()
    assert result.true != result.nominal
    assert set(result.identified.parameters) == set(result.true) == set(result.nominal)
    refused = {name for one in result.without_payload.refused for name in one.parameters}
    assert refused >= {"torque_scale", "plant.modelling_error"}
    assert result.before.validation.structure
    assert [bool(one.alarms) for one in result.watched] == [False, True, True, True, True]


@WHOLE
def test_a_wrong_result_breaks_its_check(result):
    name = next(iter(result.true))
    estimate = result.identified.parameters[name]
    far = result.true | {name: estimate.value + 2 * (estimate.interval[1] - estimate.interval[0])}
    assert broken(result._replace(true=far)) == {"found values"}
    assert broken(result._replace(after=result.before)) == {"validation", "structure"}
    assert broken(result._replace(without_payload=result.identified)) == {"refusal"}
    healthy, torque, *others = result.watched
    silent = torque._replace(alarms=())
    assert broken(result._replace(watched=(healthy, silent, *others))) == {"named changes"}
    alarmed = healthy._replace(alarms=torque.alarms)
    assert broken(result._replace(watched=(alarmed, torque, *others))) == {"false alarms"}


@WHOLE
def test_the_page_has_the_numbers_of_the_results(result, tmp_path):
    paths = workflow_page.write(tmp_path, result, "spheretwin reproduce twin")
    assert {path.name for path in paths} == {"twin.md", "twin.html"}
    text = paths[0].read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    for name, outcome in result.identified.parameters.items():
        (row,) = [row for row in rows if row[0] == name and row[-2] == outcome.unit and len(row) == 8]
        numbers = [result.nominal[name], result.true[name], outcome.value, *outcome.interval]
        # Five digits are printed.
        assert [float(cell) for cell in row[1:6]] == pytest.approx(numbers, rel=1e-4)
    for watched in result.watched[1:]:
        (row,) = [row for row in rows if row[0] == watched.change.label]
        assert row[1] == watched.named.what
        assert float(row[3]) == pytest.approx(watched.named.size, rel=1e-2)
    for reason in result.without_payload.reasons:
        assert reason in text
    for figure in re.findall(r"\]\((twin_\w+\.svg)\)", text):
        assert (tmp_path / figure).stat().st_size > 0
    assert text.count(".svg)") == 3


@WHOLE
def test_the_command_writes_the_page_and_fails_with_a_check(result, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(workflow, "run_workflow", lambda track: result._replace(after=result.before))
    folder = tmp_path / "page"
    assert cli.main(["reproduce", "twin", "--json", "--out", str(folder)]) == cli.FAILED
    out, err = capsys.readouterr()
    assert "validation" in err
    figures = json.loads(out)
    assert set(figures) == {"checks", "parameters", "refused", "chi2", "watch", "wall_s", "versions"}
    assert figures["chi2"]["after"] == result.before.validation.fit.chi2
    assert figures["watch"][1]["alarms"][0]["what"] == "torque_scale"
    assert "Created by `spheretwin reproduce twin`" in (folder / "twin.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "arguments",
    [["twin", "figure6"], ["twin", "--seeds", "20"], ["twin", "--plant", "mujoco"], ["all", "twin"]],
)
def test_the_command_refuses_what_it_would_drop(arguments, capsys):
    assert cli.main(["reproduce", *arguments]) == cli.BAD_INPUT
    assert "expected twin alone, without --seeds, --limit and --plant" in capsys.readouterr().err
