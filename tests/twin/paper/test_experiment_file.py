"""Study files of experiments: cases from crossed lists, texts with values, tables from cells."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from spheretwin.models.telemetry.status import Status
from spheretwin.paper import experiment_file
from spheretwin.paper.experiment import Outcomes
from spheretwin.paper.experiment_file import ExperimentFile
from tests.twin.paper.cases import outcome

TEXT = """
name = "short"
title = "A short one"
summary = "It is over soon."
load = [{ L = 1.0 }, { L = 2.0, fields = { "plant.engine" = "mujoco" } }]
tuned = [{ law = "pid", gain = 5.0 }, { law = "pd", gain = 6.0, is_random = false }]
again = [{ L = 2.0, part = "again", fields = { "plant.engine" = "mujoco" } }]

[every_case]
name = "{law}: L {L:g}"
scenario = "tilt"
set = { "controller.law" = "law", "disturbance.load" = "L" }
details = { gains = "gains", gain = "gain" }
fields = { duration = 0.1 }

[[case]]
cross = ["load", "tuned"]
expected = { pd = ["completed", "left_workspace"] }

[[case]]
cross = ["again", "tuned"]
seeds = 3
expected = ["completed", "failsafe"]

[errors]
title = "Errors of {quantity}"
text = "Up to {most:.1f}."
file = "{quantity}.svg"
caption = "The {quantity}."

[table.errors]
title = "Errors"
texts = 2

[table.errors.cells]
law = "{label}"
L = "{L:g}"
alpha = "{max_abs_error[0]:.0f mrad}"
beta = "{max_abs_error[1]:.1f}"
gamma = "{max_abs_error[2]:.1f}"
most = "{max_abs_error[0]:.0f mrad max}"
all = "{max_abs_error:.1f deg median}"
median = "{max_abs_error[0]:.0f mrad q0.5}"
"90 %" = "{max_abs_error[0]:.0f mrad q0.9}"
metric = "{rms_torque_Nm:.1f}"
status = "{status}, {data}"
absent = "{absent.number:.1f} {absent:.1f}"
"""

CELLS = {
    "law": "tuned PID", "L": "1", "alpha": "4 (1 to 7)", "beta": "0.1", "gamma": "–", "most": "7",
    "all": "0.2 / 5.7 / –", "median": "4 [2, 6]", "90 %": "7 [5, –]", "metric": "–",
    "status": "completed, completed", "absent": "– –",
}  # fmt: skip


@pytest.fixture
def file(monkeypatch, tmp_path):
    (tmp_path / "short.toml").write_text(TEXT, encoding="utf-8")
    monkeypatch.setattr(experiment_file, "FOLDER", tmp_path)
    return ExperimentFile("short")


def test_lists_are_crossed_and_the_last_changes_fastest(file):
    assert [case.name for case in file.cases] == ["pid: L 1", "pd: L 1", "pid: L 2", "pd: L 2"]
    pid, pd, other, _ = file.cases
    assert pid.fields == {"controller.law": "pid", "disturbance.load": 1.0, "duration": 0.1}
    assert other.fields["plant.engine"] == "mujoco"
    assert (pid.scenario, pid.seeds, pid.is_random, pd.is_random) == ("tilt", 20, True, False)
    assert pid.expected_statuses == (Status.COMPLETED,)
    assert pd.expected_statuses == (Status.COMPLETED, Status.LEFT_WORKSPACE)


def test_an_entry_that_names_a_law_has_its_columns_too(file):
    pid = file.case(law="pid")
    assert (pid.columns["label"], pid.columns["gain"]) == ("tuned PID", 5.0)
    assert pid.details == {"gains": "triple pole at 40 1/s", "gain": 5.0}


def test_a_case_of_two_blocks_is_one_case_with_the_columns_of_each(file):
    outcomes = Outcomes({"pid: L 2": [outcome(0.1)]})
    (first, again) = file.runs(outcomes, law="pid")
    assert (first.case.name, again["part"]) == ("pid: L 2", "again")
    assert file.runs(outcomes, part="again") == [again]
    assert file.runs(outcomes, law="pd") == []


def test_texts_have_their_values(file):
    section = file.section("errors", more=" And more.", quantity="angle", most=2.0)
    assert (section.title, section.text) == ("Errors of angle", "Up to 2.0. And more.")
    drawing = file.drawing("errors", Figure(), quantity="angle")
    assert (drawing.file, drawing.caption) == ("angle.svg", "The angle.")
    experiment = file.experiment(sections=lambda outcomes: [section])
    assert (experiment.name, experiment.title, experiment.cases()) == ("short", "A short one", file.cases)


def test_a_table_has_a_cell_of_each_column(file):
    runs = [outcome([0.001 * error, 0.1, np.nan], data=Status.COMPLETED) for error in range(1, 8)]
    items = file.runs(Outcomes({"pid: L 1": runs}))
    made = file.table("errors", items, {"before": "{law}"}, absent=lambda item: None)
    assert (made.title, made.head, made.texts) == ("Errors", ("before", *CELLS), 3)
    assert made.rows == [("pid", *CELLS.values())]
