"""Comparison of runs: labels, merged recording and page of figures."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spheretwin.analysis.recorded_run import Reviewed, events, of_the_actuator
from spheretwin.analysis.review import LONGEST_VALUE, common_conditions, scenario_differences
from spheretwin.analysis.run_summary import amplitudes, peaks
from spheretwin.metrics.tracking import BAND_rad
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, shortened, shown, without_breaks
from spheretwin.models.base.extras import check_recordings
from spheretwin.models.base.files import check_writable
from spheretwin.models.base.user_code import short_names
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Event, Status
from spheretwin.models.telemetry.table import Table
from spheretwin.records.provenance import facts_of
from spheretwin.scenario.sections import ResolvedScenario
from spheretwin.viz.comparison.runs import ComparedRun, EarlyEnd, Spectrum, leaders
from spheretwin.viz.layout.extents import number
from spheretwin.viz.pages import markdown
from spheretwin.viz.pages.markdown import Drawing, PageSection, ReportPage
from spheretwin.viz.quantities import Quantity, QuantityRows, angle_between, compared_quantities
from spheretwin.viz.terminal.reviews import differences as table_rows

MOST_DIFFERENCES, LEGEND_LENGTH = 6, 48
"""Differences in a label, and characters of a legend's line."""
LONGEST_STEM = 40
"""Characters of a file's name."""


def labels(runs: Sequence[Reviewed], longest: int = 10**6) -> list[str]:
    """Return a label for each run: number, file, law, and the differing fields that fit.

    A file that has the name of its law is named once. A law in a file has the name of that file, with folders
    only if two files share it.

    Parameters
    ----------
    runs : sequence of Reviewed
    longest : int
        Characters of a label; number, file and law are always included.
    """
    differences = [
        (name, values)
        for name, values in scenario_differences([run.record.scenario for run in runs])
        if name != "law"
    ][:MOST_DIFFERENCES]
    run_labels = []
    laws = short_names([_law(run) for run in runs])
    for place, (run, law) in enumerate(zip(runs, laws, strict=True), start=1):
        parts = [f"{name} {shortened(values[place - 1], LONGEST_VALUE)}" for name, values in differences]
        stem = shortened(run.path.stem, LONGEST_VALUE)
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
    check_recordings("review")
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
        RecordingSubject(of.files.actuator, run.table.signals, replace(facts_of(of.scenario), law=_law(run)))
        for run, of in zip(runs, map(of_the_actuator, runs), strict=True)
    ]
    with np.errstate(all="ignore"):  # numbers in damaged files may have any size
        merged_recording.write(path, drawn_runs, subjects, _runs_text(runs, drawn_runs))


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
            tuple(run_events := events(run)),
            _early_end(run, run_events),
            _error_text(run),
        )
        for run, name, label in run_texts
    ]


def _error_text(run: Reviewed) -> str:
    """Return the largest and the RMS error of a run as one angle, of all ticks."""
    table = run.every_tick
    error_deg = np.degrees(angle_between(table["q_rad"], table["q_ref_rad"]))
    error_deg = error_deg[np.isfinite(error_deg)]
    if not len(error_deg):
        return ""
    rms_deg = float(np.sqrt(np.mean(error_deg**2)))
    return f"largest {float(np.max(error_deg)):.3g}°, RMS {rms_deg:.3g}°"


def _early_end(run: Reviewed, events: Sequence[Event]) -> EarlyEnd | None:
    """Return time and reason of the end of a run that is not complete."""
    status = run.record.status
    if status is Status.COMPLETED:
        return None
    if status is None:
        return EarlyEnd(float(run.table["t_s"][-1]), "not closed", "the file was not closed")
    return EarlyEnd(run.simulated_s, status.replace("_", " "), events[-1][2])


def _differences(runs: Sequence[Reviewed]) -> markdown.ResultTable | str:
    """Return the fields in which scenarios differ as a table, a column for each run."""
    rows = scenario_differences([run.record.scenario for run in runs])
    if not rows:
        return "The scenarios of the runs are equal."
    head = ["field", *(f"run {place}" for place in range(1, len(runs) + 1))]
    cells = [[_plain(cell) for cell in (name, *values)] for name, values in rows]
    return markdown.ResultTable("", head, cells, len(head))


def _errors(runs: Sequence[Reviewed]) -> markdown.ResultTable:
    """Return the largest and the RMS error of each hinge, mrad, a row for each run."""
    head = ["run", *(f"{kind} {axis}" for kind in ("largest", "RMS") for axis in ANGLES)]
    cells = []
    for place, run in enumerate(runs, start=1):
        error_mrad = 1e3 * run.every_tick["error_rad"]
        figures = [*np.max(np.abs(error_mrad), axis=0), *np.sqrt(np.mean(error_mrad**2, axis=0))]
        cells.append([str(place), *map(number, figures)])
    return markdown.ResultTable("", head, cells, len(head))


def _rows(run: Reviewed, table: Table) -> QuantityRows:
    scenario, files, *_ = of_the_actuator(run)
    return QuantityRows(table, table.rows(0, 1), files.actuator, scenario.drive.current_limit_A)


def subject_of(scenario: ResolvedScenario, actuator: Actuator) -> RecordingSubject:
    """Return what is drawn of a machine without a run."""
    check_recordings("live view")
    from spheretwin.viz.recording.part import RecordingSubject  # Rerun is slow to import

    return RecordingSubject(actuator, (), facts_of(scenario))


def _law(run: Reviewed) -> str:
    return str(run.record.scenario["controller"]["law"])


def _runs_text(runs: Sequence[Reviewed], drawn_runs: Sequence[ComparedRun]) -> str:
    """Return a description of the runs in Markdown: labels, ends, differences of scenarios."""
    conditions = common_conditions([run.record.scenario for run in runs])
    lines = [f"**{_plain(conditions)}**", ""]
    for label, run in zip(labels(runs), drawn_runs, strict=True):
        end = run.early_end
        text = f"**{end.status} at {end.t_s:.3f} s**: {end.reason}" if end else "completed"
        lines.append(f"- {_plain(label)}, {text}")
    lines += ["", "**Tracking errors, mrad**", "", *_errors(runs).lines()]
    lines += ["", *PageSection("Differences of the scenarios", [_differences(runs)]).lines()]
    lines.append("The thin grey line is the reference. A cross marks the end of a run that is not complete.")
    return "\n".join(lines)


if TYPE_CHECKING:
    from spheretwin.viz.recording.part import RecordingSubject

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

FIGURES = (*TITLES, "currents", "spectra", "events")
"""Names of all figures; a run without a quantity has no figure of it."""


def write_figures(
    runs: Sequence[Reviewed], figures: Sequence[dict[str, Any]], into: Path, figure_format: str = "svg"
) -> Path:
    """Write figures and page into a folder; returns the page's path.

    They replace those of an earlier review there, also the figures that only the earlier one had.

    Parameters
    ----------
    runs : sequence of Reviewed
    figures : sequence of mapping
        Report of each run.
    into : Path
        A folder that takes files.
    figure_format : str
        Format of the figures in addition to SVG.

    Raises
    ------
    InputError
        A run has no rows, or a file cannot be written there.
    """
    from spheretwin.viz.pages import interactive  # what draws is slow to import

    drawn_runs = compared_runs(runs, every_tick=True)
    tables = [run.table for run in drawn_runs]
    leading, quantities = leaders(tables), compared_quantities(tables)
    spectra = [_spectra(run) for run in runs]
    conditions = common_conditions([run.record.scenario for run in runs])
    title = drawn_runs[0].label if len(runs) == 1 else f"{len(runs)} runs: {conditions}"
    earlier = _figure_files(into) if (into / PAGE).exists() else set()
    with np.errstate(all="ignore"):  # what damage leaves of numbers may be of any size
        drawings = _drawings(drawn_runs, leading, quantities, spectra, conditions)
        saved = markdown.save_drawings(into, drawings, figure_format)
        over_time = interactive.over_time(drawn_runs, leading, quantities)
        spectral = interactive.error_spectra(drawn_runs, spectra)
    is_thin = any(
        len(run.table) > interactive.points_per_line(drawn_runs, leading, quantities) for run in drawn_runs
    )
    sections = [
        PageSection("Signals over time", [interactive.place(interactive.OVER_TIME)]),
        PageSection("Spectra of the tracking errors", [interactive.place(interactive.SPECTRA)]),
        PageSection(
            "Metrics", ["Differences are from run 1." if len(runs) > 1 else "", _metrics(drawn_runs, figures)]
        ),
    ]
    if len(runs) > 1:
        sections.append(PageSection("Differences of the scenarios", [_differences(runs)]))
    lead = f"{USE}{THIN if is_thin else ''}\n\n{interactive.place(interactive.RUNS)}"
    command = f"spheretwin review {' '.join(shlex.quote(run.path.name) for run in runs)} --figures DIR"
    text = ReportPage("review", _plain(title), lead, sections, command).text()
    content = interactive.page(title, text, drawn_runs, over_time, spectral)
    page = markdown.save_text(into / PAGE, content)
    _remove(earlier.difference(saved))
    return page


def _figure_files(folder: Path) -> set[Path]:
    """Return the files of a folder that have the names of figures."""
    paths = (folder / f"{name}.{kind}" for name in FIGURES for kind in markdown.FIGURE_KINDS)
    return {path for path in paths if path.is_file()}


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise InputError(
                f"review {path}: expected a figure of an earlier review that can be removed,"
                f" {without_breaks(error)}"
            ) from None


def write_video(runs: Sequence[Reviewed], path: Path) -> Path:
    """Write a clip of runs as MP4, or its frames into a folder; return which of them.

    Raises
    ------
    InputError
        A run has no rows.
    SpheretwinError
        It cannot be written.
    """
    from spheretwin.viz.figures import video  # what draws is slow to import

    conditions = common_conditions([run.record.scenario for run in runs])
    return video.write(path, compared_runs(runs, every_tick=True), conditions or runs[0].path.name)


def check_video(path: Path) -> None:
    """Check that a clip can be drawn and written; raises `InputError` otherwise."""
    markdown.check_libraries("matplotlib")
    check_writable(path, ".mp4")


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
    quantities: Sequence[Quantity],
    spectra: Sequence[list[Spectrum]],
    conditions: str,
) -> Iterator[Drawing]:
    from spheretwin.viz.figures.comparison import currents, events_figure, over_time
    from spheretwin.viz.figures.comparison import spectra as of_errors

    def named(title: str) -> str:
        return f"{title}: {conditions}" if conditions else title

    for group, inside in groupby(quantities, key=lambda quantity: quantity.group):
        title = TITLES[group]
        yield Drawing(f"{group}.svg", title, over_time(runs, leading, list(inside), named(title)))
    title = "Currents of all groups"
    yield Drawing("currents.svg", title, currents(runs, named(title)))
    title = "Spectra of the tracking errors"
    yield Drawing("spectra.svg", title, of_errors(runs, spectra, named(title)))
    title = "Events"
    yield Drawing("events.svg", title, events_figure(runs, named(title)))


def _spectra(run: Reviewed) -> list[Spectrum]:
    return [
        Spectrum(*amplitudes(column, run.period_s), [(peak.frequency_Hz, peak.amplitude) for peak in
                 peaks(column, run.period_s)])
        for column in 1e3 * run.every_tick["error_rad"].T
    ]  # fmt: skip


USE = (
    "Drag to zoom, double-click to reset the view; every plot shows the values at the cursor. The"
    " buttons switch runs. The dashed dark line is the reference."
)
THIN = " Long runs are drawn by the lowest and highest value of every few ticks, a band, and their mean."


def _metrics(drawn: Sequence[ComparedRun], figures: Sequence[dict[str, Any]]) -> markdown.ResultTable:
    head = ["angles in mrad (degrees)", *(_plain(run.label) for run in drawn)]
    return markdown.ResultTable(
        "", head, [[cell.replace("\n", "; ") for cell in row] for row in table_rows(figures, BAND_rad)]
    )


def _plain(text: str) -> str:
    """Return the text with all markup escaped."""
    return "".join(f"\\{sign}" if sign in "\\`*_{}[]<>#|!" else sign for sign in text)
