"""Comparison of runs: differences of their figures, labels, merged recording and page of figures."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spheretwin.analysis.recorded_run import Reviewed, events, of_the_actuator
from spheretwin.analysis.run_summary import amplitudes, peaks
from spheretwin.models.actuator import MJCF_PATH
from spheretwin.models.base.errors import InputError, shortened, shown
from spheretwin.models.telemetry.run_record import RunFacts
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.sections import ResolvedScenario
from spheretwin.viz.comparison.runs import ComparedRun, Spectrum, leaders
from spheretwin.viz.pages import markdown
from spheretwin.viz.quantities import QuantityRows, ScalarQuantity, scalar_quantities
from spheretwin.viz.terminal.runs import differences as table_rows

# Numbers of which no difference is meaningful.
NOT_COMPARED = ("seed",)


def differences(figures: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return, for each run but the first, every number of both reports minus that of the first.

    Entry by entry for lists; None if one of the two has no value.

    Parameters
    ----------
    figures : sequence of mapping
        Report of each run.
    """
    first, *others = figures
    return [
        {
            "path": other["path"],
            **{
                name: _difference(first[name], value)
                for name, value in other.items()
                if name in first and name not in NOT_COMPARED and _are_numbers(first[name], value)
            },
        }
        for other in others
    ]


def _are_numbers(first: Any, value: Any) -> bool:
    """True if both are numbers, lists of numbers of one length, or one of these and None."""
    if isinstance(first, list) and isinstance(value, list):
        return len(first) == len(value) and all(map(_are_numbers, first, value))
    numbers = [item for item in (first, value) if item is not None]
    of_lists = all(isinstance(item, list) and all(_is_number(entry) for entry in item) for item in numbers)
    return bool(numbers) and (all(map(_is_number, numbers)) or (len(numbers) == 1 and of_lists))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _difference(first: Any, value: Any) -> Any:
    if first is None or value is None:
        return None
    if isinstance(first, list):
        return [_difference(*pair) for pair in zip(first, value, strict=True)]
    return value - first


# Fields listed first, in the notation of the paper.
FIRST_FIELDS = {
    "plant.modelling_error": "m",
    "disturbance.load": "L",
    "hardware": "hardware",
    "fault": "fault",
    "name": "scenario",
    "seed": "seed",
}
MOST_DIFFERENCES, LEGEND_LENGTH = 6, 48
"""Differences in a label, and characters of a legend's line."""
LONGEST_VALUE, LONGEST_STEM = 24, 40
"""Characters of a value in a label, and of a file's name."""

# Fields that follow from another one: if that one differs, they are not listed.
IMPLIED_FIELDS = {
    "name": ("description", "duration", "trajectory."),
    "controller.law": ("controller.",),
    "plant.modelling_error": ("plant.modelling_torque_Nm",),
    "hardware": ("sensors.", "estimator.", "drive.", "watchdog.", "plant.", "nominal."),
}


def labels(runs: Sequence[Reviewed], longest: int = 10**6) -> list[str]:
    """Return a label for each run: number, file, law, and the differing fields that fit.

    A file that has the name of its law is named once.

    Parameters
    ----------
    runs : sequence of Reviewed
    longest : int
        Characters of a label; number, file and law are always included.
    """
    parts_of_runs = differing_fields([run.record.scenario for run in runs])
    run_labels = []
    for place, (run, parts) in enumerate(zip(runs, parts_of_runs, strict=True), start=1):
        stem, law = shortened(run.path.stem, LONGEST_VALUE), _law(run)
        label = f"{place} {stem}" if stem == law else f"{place} {stem}: {law}"
        for part in parts:
            if len(label) + len(part) + 2 > longest:
                label += ", …"
                break
            label += f", {part}"
        run_labels.append(label)
    return run_labels


def names(runs: Sequence[Reviewed]) -> list[str]:
    """Return a unique word for each run, without characters that have a meaning in a path."""
    stems = [shortened(re.sub(r"[^\w-]+", "_", run.path.stem), LONGEST_STEM) for run in runs]
    return [f"run_{place}_{stem.replace('…', '_')}" for place, stem in enumerate(stems, start=1)]


def differing_fields(scenarios: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Return the fields that differ among scenarios, with their values in each, at most six."""
    flat = [dict(_fields(scenario)) for scenario in scenarios]
    all_names = list(dict.fromkeys([*FIRST_FIELDS, *(name for fields in flat for name in fields)]))
    different = [name for name in all_names if len({fields.get(name, "none") for fields in flat}) > 1]
    implied = [part for name, parts in IMPLIED_FIELDS.items() if name in different for part in parts]
    shown_fields = [
        name for name in different if name in FIRST_FIELDS or not any(map(name.startswith, implied))
    ]
    return [
        [
            f"{FIRST_FIELDS.get(name, name)} {fields.get(name, 'none')}"
            for name in shown_fields[:MOST_DIFFERENCES]
        ]
        for fields in flat
    ]


def _fields(value: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """Dotted names and values, each as a text."""
    for name, inside in value.items():
        if isinstance(inside, Mapping):
            yield from _fields(inside, f"{before}{name}.")
        else:
            yield before + name, shortened(_text(inside), LONGEST_VALUE)


def _text(value: Any) -> str:
    """Return a value as text: a whole number without a point, for entries of a list their names."""
    if isinstance(value, str):
        return value
    if isinstance(value, list) and all(isinstance(item, Mapping) for item in value):
        words = [" ".join(word for word in item.values() if isinstance(word, str)) for item in value]
        return " + ".join(words) or "none"
    return f"{value:g}" if isinstance(value, float) and value == float(f"{value:g}") else json.dumps(value)


SUFFIX = ".rrd"


def check_merge(path: Path, runs: Sequence[Path]) -> None:
    """Refuse an output of another kind, an existing file, and a file of the runs.

    Raises
    ------
    InputError
        Its name does not end in ``.rrd``, it exists, or it is the name of a run of which only partial files
        exist.
    """
    if path.suffix != SUFFIX:
        raise InputError(f"command line: expected --merge OUT{SUFFIX}, received {shown(str(path))}")
    if path.exists():
        raise InputError(f"command line: expected a new file for --merge, received {path}, which exists")
    if path in runs:
        raise InputError(f"command line: expected a new file for --merge, received {path}, which is a run")


def merge(runs: Sequence[Reviewed], path: Path) -> None:
    """Write one recording of several runs.

    Raises
    ------
    InputError
        One has no rows, another number of coil groups than the first, or a model that cannot be drawn.
    SpheretwinError
        The file cannot be written; the previous file is unchanged.
    """
    from spheretwin.viz.comparison import merged_recording  # Rerun is slow to import
    from spheretwin.viz.recording.part import RecordingSubject

    drawn_runs = compared_runs(runs)
    groups = [run.table["current_A"].shape[1] for run in runs]
    for run, count in zip(runs, groups, strict=True):
        if count != groups[0]:
            raise InputError(
                f"review {run.path}: expected an actuator of {groups[0]} coil groups as the first run has,"
                f" received one of {count}"
            )
    subjects = [
        RecordingSubject(of.files.actuator, run.table.signals, _facts(of.scenario, _law(run)))
        for run, of in zip(runs, map(of_the_actuator, runs), strict=True)
    ]
    with np.errstate(all="ignore"):  # numbers in damaged files may have any size
        merged_recording.write(path, drawn_runs, subjects, _runs_text(runs))


def compared_runs(runs: Sequence[Reviewed], *, every_tick: bool = False) -> list[ComparedRun]:
    """Return the runs in the form in which they are drawn together.

    Parameters
    ----------
    runs : sequence of Reviewed
    every_tick : bool
        With a row for each tick, also if the file has fewer rows.

    Raises
    ------
    InputError
        One has no rows.
    """
    for run in runs:
        if not len(run.table):
            raise InputError(f"review {run.path}: expected a run of at least one tick to draw, received none")
    run_texts = zip(runs, names(runs), labels(runs, LEGEND_LENGTH), strict=True)
    return [
        ComparedRun(
            name,
            label,
            _law(run),
            run.period_s,
            _rows(run, run.every_tick if every_tick else run.table),
            run.metadata,
            tuple(events(run)),
        )
        for run, name, label in run_texts
    ]


def _rows(run: Reviewed, table: Table) -> QuantityRows:
    scenario, files, *_ = of_the_actuator(run)
    return QuantityRows(table, table.rows(0, 1), files.actuator, scenario.drive.current_limit_A)


def _facts(scenario: ResolvedScenario, law: str) -> RunFacts:
    return RunFacts(
        name=scenario.name,
        description=scenario.description,
        law=law,
        duration_s=scenario.duration,
        current_limit_A=scenario.drive.current_limit_A,
        payload_kg=scenario.plant.payload_kg,
        gravity_m_s2=scenario.plant.gravity_m_s2,
        mjcf=Path(scenario.plant.mjcf or MJCF_PATH),
        sections={},
    )


def _law(run: Reviewed) -> str:
    return str(run.record.scenario["controller"]["law"])


def _runs_text(runs: Sequence[Reviewed]) -> str:
    """Return a description of each run in Markdown, with the label that it has in every plot."""
    status = (f"{run.record.status or 'not closed'} at {run.simulated_s:.3f} s" for run in runs)
    lines = [f"- **{label}**, {ended}" for label, ended in zip(labels(runs), status, strict=True)]
    return "\n".join([*lines, "", "The thin white line is the reference."])


if TYPE_CHECKING:
    from spheretwin.viz.pages.markdown import Drawing

PAGE = "review.html"

TITLES = {
    "whole": "Tracking error as one angle",
    "error": "Tracking error of each hinge",
    "angle": "Hinge angles and their references",
    "sliding": "Sliding variables",
    "effort": "Torque and current",
    "more": "Delivered torque",
}
"""Title of the figure of each group of quantities."""


def write_figures(runs: Sequence[Reviewed], figures: Sequence[dict[str, Any]], into: Path) -> Path:
    """Write figures and page into a folder; returns the page's path.

    Parameters
    ----------
    runs : sequence of Reviewed
    figures : sequence of mapping
        Report of each run.
    into : Path
        A folder that takes files.

    Raises
    ------
    InputError
        A run has no rows, or a file cannot be written there.
    """
    from spheretwin.viz.pages import interactive  # what draws is slow to import

    drawn_runs = compared_runs(runs, every_tick=True)
    tables = [run.table for run in drawn_runs]
    leading, quantities = leaders(tables), scalar_quantities(tables)
    spectra = [_spectra(run) for run in runs]
    title = drawn_runs[0].label if len(runs) == 1 else f"{len(runs)} runs"
    with np.errstate(all="ignore"):  # what damage leaves of numbers may be of any size
        markdown.save_drawings(into, _drawings(drawn_runs, leading, quantities, spectra), vector=True)
        over_time = interactive.over_time(drawn_runs, leading, quantities)
    content = interactive.page(
        title,
        drawn_runs,
        over_time,
        interactive.error_spectra(drawn_runs, spectra),
        _above(title, drawn_runs, interactive.points_per_line(drawn_runs, leading, quantities)),
        _below(drawn_runs, figures),
    )
    return markdown.save_text(into / PAGE, content)


def check_figures(into: Path) -> None:
    """Check that all figures can be drawn and written, and make an empty folder.

    Raises
    ------
    InputError
        A library for figures is not installed, or the folder cannot be made or written to.
    """
    markdown.prepare(into, "plotly")


def _drawings(
    runs: Sequence[ComparedRun],
    leading: Sequence[int],
    quantities: Sequence[ScalarQuantity],
    spectra: Sequence[list[Spectrum]],
) -> Iterator[Drawing]:
    from spheretwin.viz.figures.comparison import currents, events_figure, over_time
    from spheretwin.viz.figures.comparison import spectra as of_errors
    from spheretwin.viz.pages.markdown import Drawing

    for group, inside in groupby(quantities, key=lambda quantity: quantity.group):
        title = TITLES[group]
        yield Drawing(f"{group}.png", title, over_time(runs, leading, list(inside), title))
    yield Drawing("currents.png", title := "Currents of all groups", currents(runs, title))
    yield Drawing("spectra.png", title := "Spectra of the tracking errors", of_errors(runs, spectra, title))
    yield Drawing("events.png", title := "Events", events_figure(runs, title))


def _spectra(run: Reviewed) -> list[Spectrum]:
    return [
        Spectrum(*amplitudes(column, run.period_s), [(peak.frequency_Hz, peak.amplitude) for peak in
                 peaks(column, run.period_s)])
        for column in 1e3 * run.every_tick["error_rad"].T
    ]  # fmt: skip


def _above(title: str, runs: Sequence[ComparedRun], most: int) -> str:
    thin = any(len(run.table) > most for run in runs)
    lines = [
        f"# {_plain(title)}",
        "",
        "Drag to zoom, double-click to reset the view; every plot shows the values at the cursor. The"
        " buttons switch runs. The wide grey line is the reference.",
    ]
    if thin:
        lines.append("Long runs are drawn by the lowest and highest value of every few ticks.")
    return "\n".join(lines)


def _below(runs: Sequence[ComparedRun], figures: Sequence[dict[str, Any]]) -> str:
    head = ["differences from run 1" if len(runs) > 1 else "", *(_plain(run.label) for run in runs)]
    rows = [[cell.replace("\n", "; ") for cell in row] for row in table_rows(figures)]
    return "\n".join(["## Figures", "", *markdown.table(head, rows, [False] + [True] * len(runs))])


def _plain(text: str) -> str:
    """Return the text with all markup escaped."""
    return "".join(f"\\{sign}" if sign in "\\`*_{}[]<>#|!" else sign for sign in text)
