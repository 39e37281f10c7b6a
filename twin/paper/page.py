"""Page of the experiments: reproduced results of the paper, then a chapter each; rows of the JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.status import Status
from spheretwin.paper.cells import ERRORS, figures_named
from spheretwin.paper.experiment import Case, Experiment, ExperimentSection, Outcomes, RunOutcome, Statement
from spheretwin.paper.runner import CaseSummary, Plan, PlanResult, command_line, summarise
from spheretwin.study.agreement import BOUND
from spheretwin.study.statistics import finite_ends
from spheretwin.viz.pages.markdown import PageSection, ReportPage, ResultTable, save_text

if TYPE_CHECKING:
    from spheretwin.viz.comparison.runs import LawTrajectory


TITLE = "Reproduction of the paper's results"
NAME = "reproduce"

MOST_COMMANDS = 200
"""Largest number of commands on the page; more are in a file next to it."""

REPRODUCED = "Results of the paper"
MARKS = {True: "**reproduced**", False: "**not reproduced**"}
FURTHER = "Further findings"


class Chapter(NamedTuple):
    """One experiment on the page."""

    experiment: Experiment
    sections: Sequence[ExperimentSection]
    findings: Sequence[Statement] = ()
    commands: Sequence[str] = ()
    """Command that runs each row alone, with the first seed."""
    plants: str = ""
    """Plants of the rows, and their differences."""
    trajectories: Mapping[str, LawTrajectory] = {}
    """Runs for a recording, by the labels of their laws."""


def chapter_of(result: PlanResult, rows: Sequence[Mapping[str, Any]]) -> Chapter:
    """Chapter of an experiment from its outcomes and the rows of its JSON."""
    experiment, outcomes = result.plan.experiment, result.outcomes
    return Chapter(
        experiment,
        experiment.sections(outcomes),
        experiment.findings(outcomes),
        [row["command"] for row in rows],
        plants_text([row["plant"] for row in rows], result.differences),
        experiment.trajectories(outcomes),
    )


def write(folder: Path, chapters: Sequence[Chapter], command: str, figure_format: str = "svg") -> list[Path]:
    """Write the page, its figures and its recordings; return both forms of the page and the recordings.

    Parameters
    ----------
    folder : Path
        Exists.
    chapters : sequence of Chapter
    command : str
        Command that creates the page.
    figure_format : str
        Format of the figures in addition to SVG.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    lead, sections = _results(chapters)
    sections += map(_chapter, chapters)
    recorded = [chapter for chapter in chapters if chapter.trajectories and find_spec("rerun")]
    recordings = [_recorded(folder, chapter) for chapter in recorded]
    for chapter in chapters:
        if len(chapter.commands) > MOST_COMMANDS:
            save_text(folder / _commands_file(chapter), "\n".join([*chapter.commands, ""]))
    return [*ReportPage(NAME, TITLE, lead, sections, command).write(folder, figure_format), *recordings]


def _chapter(chapter: Chapter) -> PageSection:
    """Section of an experiment."""
    inner = [
        PageSection(section.title, [section.text, *section.tables, *(draw() for draw in section.drawings)])
        for section in chapter.sections
    ]
    return PageSection(
        chapter.experiment.title, [chapter.experiment.summary, chapter.plants, *inner, *_commands(chapter)]
    )


def _results(chapters: Sequence[Chapter]) -> tuple[str, list[PageSection]]:
    """Summary with the number of reproduced results, and sections with a row for each finding."""
    findings = [(chapter.experiment.name, finding) for chapter in chapters for finding in chapter.findings]
    of_paper = [
        (name, MARKS[finding.reproduced], f"{finding.text}.")
        for name, finding in findings
        if finding.reproduced is not None
    ]
    further = [(name, f"{finding.text}.") for name, finding in findings if finding.reproduced is None]
    summary, sections = [f"Experiments: {len(chapters)}; findings: {len(findings)}."], []
    if of_paper:
        count = sum(bool(finding.reproduced) for _, finding in findings)
        summary.append(f"{count} of {len(of_paper)} results of the paper were reproduced.")
        sections.append(
            PageSection(REPRODUCED, [ResultTable("", ("experiment", "verdict", "result"), of_paper, 3)])
        )
    if further:
        sections.append(PageSection(FURTHER, [ResultTable("", ("experiment", "finding"), further, 2)]))
    return "\n".join(summary), sections


def _commands(chapter: Chapter) -> list[PageSection]:
    """Commands that run single rows."""
    if not chapter.commands:
        return []
    if len(chapter.commands) > MOST_COMMANDS:
        file = _commands_file(chapter)
        text = f"The commands of {len(chapter.commands)} rows are in [{file}]({file})"
        parts = [f"{text}, in the order of the JSON."]
    else:
        text = "One command for each row of the JSON, in its order, with the first seed; further seeds"
        parts = [f"{text} follow it.", "\n".join(["```sh", *chapter.commands, "```"])]
    return [PageSection("Commands for single runs", parts)]


def _recorded(folder: Path, chapter: Chapter) -> Path:
    from spheretwin.viz.comparison import trajectories

    name = chapter.experiment.name
    return trajectories.write(
        folder / f"{name}.rrd", chapter.trajectories, actuators.load(), chapter.experiment.title
    )


def _commands_file(chapter: Chapter) -> str:
    return f"{chapter.experiment.name}_commands.txt"


EFFORT = {"rms_torque_Nm": "rms_torque_range_Nm", "current_variation_A_s": "current_variation_range_A_s"}
"""Metrics of the effort; the JSON has their median, and lowest and highest, over the seeds."""

PLANT_LABELS = {"lagrangian": "the Lagrangian", "mujoco": "MuJoCo"}


def rows(
    plan: Plan, outcomes: Outcomes, summaries: Mapping[str, CaseSummary] | None = None
) -> list[dict[str, Any]]:
    """Rows of an experiment, in the order of its cases.

    Parameters
    ----------
    plan : Plan
    outcomes : Outcomes
    summaries : mapping, optional
        `summarise` of the plan, if it is known already.
    """
    summaries = summaries or summarise(plan)
    return [_row(plan, case, summaries[case.name], outcomes[case.name]) for case in plan.cases]


def _row(plan: Plan, case: Case, summary: CaseSummary, outcomes: Sequence[RunOutcome]) -> dict[str, Any]:
    return {
        "figure": plan.experiment.name,
        "case": case.name,
        **summary.fields,
        "fields": dict(case.fields),
        "command": command_line(case, summary.fields["plant"]),
        "seeds": len(outcomes),
        **_errors(outcomes),
        **_effort(outcomes),
        "status": _status(case, outcomes),
        "statuses": dict(sorted(Counter(str(outcome.status) for outcome in outcomes).items())),
        "paper": None,
        **case.details,
        **plan.experiment.row_fields(case, outcomes),
    }


def _errors(outcomes: Sequence[RunOutcome]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for name, error in ERRORS.items():
        values = np.array([error(outcome) for outcome in outcomes])
        fields[f"{name}_rad"] = np.median(values, axis=0).tolist()
        fields[f"{name}_median_95_rad"] = [finite_ends(of_hinge) for of_hinge in values.T]
        fields[f"{name}_range_rad"] = np.stack([values.min(axis=0), values.max(axis=0)], axis=1).tolist()
    return fields


def _effort(outcomes: Sequence[RunOutcome]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for name, range_name in EFFORT.items():
        values = figures_named(outcomes, name)
        numbers = values[np.isfinite(values)]
        fields[name] = float(np.median(numbers)) if len(numbers) else None
        fields[range_name] = [float(numbers.min()), float(numbers.max())] if len(numbers) else None
    return fields


def _status(case: Case, outcomes: Sequence[RunOutcome]) -> Status:
    """Unexpected status of any run, else the most frequent status."""
    counts = Counter(outcome.status for outcome in outcomes)
    unexpected = [status for status in counts if status not in case.expected_statuses]
    return unexpected[0] if unexpected else counts.most_common(1)[0][0]


def plants_text(plants: Sequence[str], differences: Sequence[float]) -> str:
    """Sentence on the plants of the rows, and on the differences of a sample on both plants.

    Parameters
    ----------
    plants : sequence of str
        Plant of each row.
    differences : sequence of float
        Difference of each run of the sample, from `runner.compare_plants`.
    """
    counts = sorted(Counter(plants).items())
    listed = " and ".join(f"{count} on {PLANT_LABELS.get(plant, plant)}" for plant, count in counts)
    if not differences:
        return f"Rows: {listed}."
    return (
        f"Rows: {listed}. {len(differences)} of their runs were made on MuJoCo too: the RMS errors differ by"
        f" at most {max(differences):.1e} of the largest of a run's three (bound {BOUND:g})."
    )
