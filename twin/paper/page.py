"""What the experiments found as one page: Markdown, HTML of the same content, and the figures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from spheretwin.models import actuator as actuators
from spheretwin.paper.experiment import Experiment, Finding, Section
from spheretwin.paper.rows import plants_text
from spheretwin.paper.runner import PlanResult
from spheretwin.viz.pages import html
from spheretwin.viz.pages import markdown as pieces
from spheretwin.viz.pages.markdown import Drawing, save_drawings, save_text

if TYPE_CHECKING:
    from spheretwin.viz.comparison.trajectories import LawTrajectory

TITLE = "What the paper shows, run again"
MARKDOWN, HTML = "reproduce.md", "reproduce.html"


MOST_COMMANDS = 200
"""On the page; of an experiment of more rows they are in a file beside it."""

FIRST = "What was reproduced, and what was not"
MARKS = {True: "**reproduced**", False: "**not reproduced**"}
BESIDES = "What was found besides"


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


def write(folder: Path, chapters: Sequence[Chapter], command: str, versions: Mapping[str, str]) -> list[Path]:
    """Write the page, its figures and its recordings into a folder; returns both forms of the page and these.

    Parameters
    ----------
    folder : Path
        Exists.
    chapters : sequence of Chapter
    command : str
        What makes the page again, for its foot.
    versions : mapping
        Version by package, for the same.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    drawings = [
        [[draw() for draw in section.drawings] for section in chapter.sections] for chapter in chapters
    ]
    every = (drawing for of_chapter in drawings for of_section in of_chapter for drawing in of_section)
    save_drawings(folder, every, vector=True)
    recordings = [_recorded(folder, chapter) for chapter in chapters if chapter.trajectories]
    for chapter in chapters:
        if len(chapter.commands) > MOST_COMMANDS:
            save_text(folder / _commands_file(chapter), "\n".join([*chapter.commands, ""]))
    text = markdown(chapters, drawings, command, versions)
    return [
        save_text(folder / MARKDOWN, text),
        save_text(folder / HTML, html.page(TITLE, text, folder)),
        *recordings,
    ]


def markdown(
    chapters: Sequence[Chapter],
    drawn: Sequence[Sequence[Sequence[Drawing]]],
    command: str,
    versions: Mapping[str, str],
) -> str:
    """Text of the page."""
    used = ", ".join(f"{name} {version}" for name, version in versions.items())
    lines = [f"# {TITLE}", "", *_first(chapters)]
    for chapter, drawings in zip(chapters, drawn, strict=True):
        lines += [f"## {chapter.experiment.title}", "", chapter.experiment.summary, ""]
        lines += [chapter.plants, ""] if chapter.plants else []
        for section, of_section in zip(chapter.sections, drawings, strict=True):
            lines += _section(section, of_section)
        lines += _alone(chapter)
    lines += [f"Made by `{command}` with {used}.", ""]
    return "\n".join(lines)


def _first(chapters: Sequence[Chapter]) -> list[str]:
    """The first page: a line a finding, those on the paper first."""
    findings = [(chapter.experiment.name, finding) for chapter in chapters for finding in chapter.findings]
    of_paper = [
        (name, MARKS[finding.reproduced], f"{finding.text}.")
        for name, finding in findings
        if finding.reproduced is not None
    ]
    others = [(name, f"{finding.text}.") for name, finding in findings if finding.reproduced is None]
    lines = []
    if of_paper:
        lines += [
            f"## {FIRST}",
            "",
            *pieces.table(("", "", "of what the paper shows"), of_paper, (False,) * 3),
            "",
        ]
    if others:
        lines += [f"## {BESIDES}", "", *pieces.table(("", "what was found"), others, (False,) * 2), ""]
    return lines


def _alone(chapter: Chapter) -> list[str]:
    """How each row is run alone."""
    if not chapter.commands:
        return []
    lines = ["### Each row alone", ""]
    if len(chapter.commands) > MOST_COMMANDS:
        file = _commands_file(chapter)
        said = f"The command lines of {len(chapter.commands)} rows are in [{file}]({file})"
        return [*lines, f"{said}, in the order of the JSON.", ""]
    said = "A line a row of the JSON, in its order, under the first seed; the others count on from it."
    return [*lines, said, "", "```sh", *chapter.commands, "```", ""]


def _recorded(folder: Path, chapter: Chapter) -> Path:
    from spheretwin.viz.comparison import trajectories

    name = chapter.experiment.name
    return trajectories.write(
        folder / f"{name}.rrd", chapter.trajectories, actuators.load(), chapter.experiment.title
    )


def _commands_file(chapter: Chapter) -> str:
    return f"{chapter.experiment.name}_commands.txt"


def _section(section: Section, drawings: Iterable[Drawing]) -> list[str]:
    lines = [f"### {section.title}", "", section.text, ""]
    for table in section.tables:
        numbers = [column >= table.texts for column in range(len(table.head))]
        lines += [f"**{table.title}**", "", *pieces.table(table.head, table.rows, numbers), ""]
    return [*lines, *map(pieces.figure, drawings)]
