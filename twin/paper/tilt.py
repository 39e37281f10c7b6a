"""Figure 11: the tilt with the prototype's electronics, with the printed gains and with single changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from spheretwin.paper.cells import NONE, of_axis
from spheretwin.paper.experiment import (
    Array,
    Case,
    ExperimentSection,
    Outcomes,
    RunOutcome,
    Statement,
    padded,
    window_maxima,
)
from spheretwin.paper.experiment_file import CaseRuns, ExperimentFile
from spheretwin.paper.runner import measured_error
from spheretwin.run import Run
from spheretwin.viz.pages.markdown import Drawing

FILE = ExperimentFile("figure11")

ALPHA, BETA = 0, 1

WINDOW_s = 0.02
"""Window of the figure of the errors: each point is the largest error within one."""

BANDWIDTHS_rad_s = np.geomspace(25, 1600, 13)

REACHED = 1.05
"""Times the paper's figure: it is read from a plot, to two digits."""

Errors = tuple[Array, Array]
"""Largest measured and true error of α for each seed, rad."""


def reduce(run: Run) -> Array:
    """Largest measured |error| of α and β in each window of the figure, (windows, 2) in rad."""
    error = measured_error(run)[:, [ALPHA, BETA]]
    return window_maxima(error, WINDOW_s, run.scenario.controller.period_s)


def row_fields(case: Case, outcomes: Sequence[RunOutcome]) -> Mapping[str, Any]:
    """Errors of the paper's figure, for the JSON."""
    law = case.columns
    if "paper_deg" not in law:
        return {}
    paper = float(np.radians(law["paper_deg"]))
    by_axis = [paper if axis in law["paper_axes"] else None for axis in range(3)]
    return {"paper": by_axis, "paper_relation": law["relation"]}


def paper_text(law: CaseRuns) -> str:
    """Largest error of α in the paper's figure, for a table."""
    columns = law.case.columns
    return f"{columns['relation']} {columns['paper_deg']:g}" if "paper_deg" in columns else NONE


def errors_drawing(items: Sequence[CaseRuns]) -> Drawing:
    """Measured |error| of α and β over time, of the laws as printed."""
    from spheretwin.viz.figures import over_time as figures

    courses = {}
    for item in items:
        columns = item.case.columns
        origin = f"paper {paper_text(item)}°" if "paper_deg" in columns else item["gains"]
        courses[f"{item['label']} ({origin})"] = figures.ErrorBand(
            item["law"],
            padded([run.data for run in item.runs]),
            np.radians(columns.get("paper_deg", 0.0)),
            tuple(columns.get("paper_axes", ())),
        )
    title = "Tilt with the prototype's electronics: measured error"
    figure = figures.errors(courses, WINDOW_s, ("α", "β"), title)
    return FILE.drawing("printed", figure, window_ms=1e3 * WINDOW_s)


def changes_drawing(outcomes: Outcomes) -> Drawing:
    """Largest error of α as printed and under every single change, by law."""
    from spheretwin.viz.figures import over_time as figures

    groups = []
    for law in FILE["law"]:
        lines = [
            figures.ErrorLine(item.case.columns.get("change", "unchanged"), *map(np.degrees, _alpha(item)))
            for item in FILE.runs(outcomes, law=law["law"])
        ]
        if lines:
            groups.append(figures.ErrorGroup(law["law"], law["label"], lines, law.get("paper_deg")))
    figure = figures.lines(groups, "largest |error| of α, degrees", "One change at a time")
    return FILE.drawing("changes", figure)


def estimators_drawing() -> Drawing:
    """Errors and lags of the estimators over their bandwidths."""
    from spheretwin.control.estimators.noise_and_lag import compare
    from spheretwin.viz.figures import conditions as figures

    curves = {kind: figures.Curve(*result) for kind, result in compare(BANDWIDTHS_rad_s.tolist()).items()}
    figure = figures.estimators(BANDWIDTHS_rad_s, curves, "Rates of the paper's sinusoid from noisy angles")
    return FILE.drawing("rates", figure)


MEASURED, TRUE = "measured_max_abs_error", "max_abs_error"


def printed_section(outcomes: Outcomes) -> ExperimentSection:
    """Errors of the laws next to the paper's, and their course."""
    items = FILE.runs(outcomes, as_printed=True)
    order = "".join(f" T{finding.text.removeprefix('t')}." for finding in _order(outcomes))
    drawings = [lambda: errors_drawing(items)] if items else []
    return FILE.section("printed", [FILE.table("printed", items, paper_text=paper_text)], drawings, order)


def findings(outcomes: Outcomes) -> list[Statement]:
    """Compare order and sizes of the errors with the paper's."""
    return [*_order(outcomes), *_sizes(outcomes)]


def _printed(outcomes: Outcomes) -> list[CaseRuns]:
    """Laws of the paper as printed, of which runs exist."""
    laws = FILE.runs(outcomes, as_printed=True)
    return [law for law in laws if "paper_deg" in law.case.columns]


def _order(outcomes: Outcomes) -> list[Statement]:
    """Compare the order of the laws with the paper's, seed by seed."""
    of_paper = _printed(outcomes)
    if len(of_paper) < sum("paper_deg" in law for law in FILE["law"]):
        return []
    errors = np.array([of_axis(law.runs, MEASURED, ALPHA) for law in of_paper])
    right, seeds = int(np.sum(np.all(np.diff(errors, axis=0) < 0, axis=0))), errors.shape[1]
    order = " > ".join(law["label"] for law in of_paper)
    text = f"the paper's order, {order}, holds for α under {right} of {seeds} seeds"
    return [Statement(right == seeds, text)]


def _sizes(outcomes: Outcomes) -> list[Statement]:
    """Compare the measured errors of α with the paper's."""
    texts, reproduced = [], True
    for law in _printed(outcomes):
        median = float(np.degrees(np.median(of_axis(law.runs, MEASURED, ALPHA))))
        reproduced = reproduced and median <= REACHED * law["paper_deg"]
        texts.append(f"{law['label']} {median:.2f}° (paper {paper_text(law)})")
    if not texts:
        return []
    why = "" if reproduced else "; its chapter lists the single changes with which a law reaches it"
    return [Statement(reproduced, f"largest measured error of α: {', '.join(texts)}{why}")]


def change_section(outcomes: Outcomes) -> ExperimentSection:
    """Errors under every single change."""
    items = FILE.runs(outcomes, as_printed=False)
    tables = [FILE.table("changes", items, paper_text=paper_text, reached=_reached)]
    drawings = [lambda: changes_drawing(outcomes)] if items else []
    return FILE.section("changes", tables, drawings, _sufficient_changes(items), times=REACHED)


def reached(paper_deg: float | None, measured: Array, true: Array) -> str:
    """State if a law reaches the paper's figure, from the errors (rad) of all seeds."""
    if paper_deg is None:
        return NONE
    limit = REACHED * np.radians(paper_deg)
    if np.median(measured) <= limit:
        return "yes"
    return "by the true error" if np.median(true) <= limit else "no"


def _reached(item: CaseRuns) -> str:
    return reached(item.case.columns.get("paper_deg"), *_alpha(item))


def _sufficient_changes(items: Sequence[CaseRuns]) -> str:
    """List the changes of each law that reach the paper's figure with the prototype's electronics."""
    labels: dict[str, list[str]] = {}
    for item in items:
        if "hardware" in item.case.fields and _reached(item) == "yes":
            labels.setdefault(item["label"], []).append(item["change"])
    text = "; ".join(f"{law} by {' or '.join(of_law)}" for law, of_law in labels.items())
    return f" What brings a law there with these electronics: {text}." if text else ""


def _alpha(item: CaseRuns) -> Errors:
    return of_axis(item.runs, MEASURED, ALPHA), of_axis(item.runs, TRUE, ALPHA)


def sections(outcomes: Outcomes) -> list[ExperimentSection]:
    """Errors as printed, the changes, and the estimators."""
    rates = FILE.section("rates", drawings=[estimators_drawing])
    return [printed_section(outcomes), change_section(outcomes), rates]


EXPERIMENT = FILE.experiment(sections=sections, reduce=reduce, row_fields=row_fields, findings=findings)
