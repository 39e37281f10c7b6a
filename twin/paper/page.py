"""Page of the experiments: results of the paper that were reproduced, then a chapter for each experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from spheretwin.models import actuator as actuators
from spheretwin.paper.experiment import Experiment, Finding, Section
from spheretwin.paper.rows import plants_text
from spheretwin.paper.runner import PlanResult
from spheretwin.viz.pages import markdown as pieces
from spheretwin.viz.pages.markdown import Drawing, save_text, write_page

if TYPE_CHECKING:
    from spheretwin.viz.comparison.trajectories import LawTrajectory

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
    sections: Sequence[Section]
    findings: Sequence[Finding] = ()
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


def write(
    folder: Path,
    chapters: Sequence[Chapter],
    command: str,
    figure_format: str = "svg",
) -> list[Path]:
    """Write the page, its figures and its recordings into a folder; returns both forms of the page and these.

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
    drawings: list[Drawing] = []
    summary, sections = _results(chapters)
    sections += [line for chapter in chapters for line in _chapter(chapter, drawings)]
    recordings = [_recorded(folder, chapter) for chapter in chapters if chapter.trajectories]
    for chapter in chapters:
        if len(chapter.commands) > MOST_COMMANDS:
            save_text(folder / _commands_file(chapter), "\n".join([*chapter.commands, ""]))
    return [
        *write_page(folder, NAME, TITLE, summary, sections, drawings, command, figure_format),
        *recordings,
    ]


def _chapter(chapter: Chapter, drawings: list[Drawing]) -> list[str]:
    """Lines of an experiment; its figures are added to the drawings."""
    lines = [f"## {chapter.experiment.title}", "", chapter.experiment.summary, ""]
    lines += [chapter.plants, ""] if chapter.plants else []
    for section in chapter.sections:
        of_section = [draw() for draw in section.drawings]
        drawings += of_section
        lines += [*_section(section), *map(pieces.figure, of_section)]
    return [*lines, *_commands(chapter)]


def _results(chapters: Sequence[Chapter]) -> tuple[list[str], list[str]]:
    """Summary with the number of reproduced results, and sections with a row for each finding."""
    findings = [(chapter.experiment.name, finding) for chapter in chapters for finding in chapter.findings]
    of_paper = [
        (name, MARKS[finding.reproduced], f"{finding.text}.")
        for name, finding in findings
        if finding.reproduced is not None
    ]
    further = [(name, f"{finding.text}.") for name, finding in findings if finding.reproduced is None]
    summary, lines = [f"{len(chapters)} experiments, {len(findings)} findings."], []
    if of_paper:
        count = sum(bool(finding.reproduced) for _, finding in findings)
        table = pieces.table(("experiment", "verdict", "result"), of_paper, (False,) * 3)
        summary.append(f"{count} of {len(of_paper)} results of the paper were reproduced.")
        lines += [f"## {REPRODUCED}", "", *table, ""]
    if further:
        table = pieces.table(("experiment", "finding"), further, (False,) * 2)
        lines += [f"## {FURTHER}", "", *table, ""]
    return summary, lines


def _commands(chapter: Chapter) -> list[str]:
    """Commands that run single rows."""
    if not chapter.commands:
        return []
    lines = ["### Commands for single runs", ""]
    if len(chapter.commands) > MOST_COMMANDS:
        file = _commands_file(chapter)
        text = f"The commands of {len(chapter.commands)} rows are in [{file}]({file})"
        return [*lines, f"{text}, in the order of the JSON.", ""]
    text = "One command for each row of the JSON, in its order, with the first seed; further seeds follow it."
    return [*lines, text, "", "```sh", *chapter.commands, "```", ""]


def _recorded(folder: Path, chapter: Chapter) -> Path:
    from spheretwin.viz.comparison import trajectories

    name = chapter.experiment.name
    return trajectories.write(
        folder / f"{name}.rrd", chapter.trajectories, actuators.load(), chapter.experiment.title
    )


def _commands_file(chapter: Chapter) -> str:
    return f"{chapter.experiment.name}_commands.txt"


def _section(section: Section) -> list[str]:
    lines = [f"### {section.title}", "", section.text, ""]
    for table in section.tables:
        numbers = [column >= table.texts for column in range(len(table.head))]
        lines += [f"**{table.title}**", "", *pieces.table(table.head, table.rows, numbers), ""]
    return lines
