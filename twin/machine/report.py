"""Tables and figures of identification and validation, and the page of an identification."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.machine.discrepancy import Suggestion
from spheretwin.machine.excitation import Design
from spheretwin.machine.identification import Identified, identifiability
from spheretwin.machine.log import Log
from spheretwin.machine.refusals import correlation_sentences
from spheretwin.machine.state_estimation import chi2_text
from spheretwin.machine.twin_file import Identification, history_drawing
from spheretwin.machine.validation import QUANTITIES, ResidualFit, Structure
from spheretwin.machine.verdict import LogVerdict, check
from spheretwin.models.mjcf_reader import HINGES
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.pages.markdown import Drawing, PageSection, ReportPage, ResultTable, save_text

MOST_ROWS = 5
"""Suggestions, changes and bins that the terminal shows."""

NO_SUGGESTION = "no parameter that is not identified would improve the held-out windows"

LABELS = ("before identification", "after identification")

# Correlation from which two parameters are a sentence.
_CORRELATED = 0.3


def parameter_table(result: Identified, **others: Mapping[str, float]) -> ResultTable:
    """Return the identified values with their intervals, after others by name."""
    rows = [
        (
            name,
            *(f"{value:.5g}" for value in (*(by_name[name] for by_name in others.values()), one.value)),
            *(f"{end:.5g}" for end in one.interval),
            one.unit,
            f"{one.widening:.2f}",
        )
        for name, one in result.parameters.items()
    ]
    head = ("parameter", *others, "found", "from", "to (95 %)", "unit", "widening")
    return ResultTable("identified", head, rows, 1, ("unit",))


def suggestion_table(suggestions: Sequence[Suggestion]) -> ResultTable:
    """Return what would improve the held-out windows."""
    rows = [
        (one.what, f"{one.gain:+.1f}", f"{one.chi2:.3f}", one.member, f"{one.departure:+.3g}", one.unit)
        for one in suggestions
    ]
    head = ("identify also", "log likelihood", "mean square", "largest departure", "of", "unit")
    return ResultTable("what would improve the held-out windows", head, rows, 1, (head[3], "unit"))


def structure_table(structure: Sequence[Structure]) -> ResultTable:
    """Return the clearest changes that the residuals show."""
    rows = [
        (one.what, f"{one.size:+.3g}", one.unit, f"{one.deviations:+.1f}") for one in structure[:MOST_ROWS]
    ]
    head = ("a change alone of", "explains", "unit", "standard deviations from 0")
    return ResultTable("what the residuals show", head, rows, 1, ("unit",))


def design_table(design: Design) -> ResultTable:
    """Return what a designed motion determines."""
    rows = [
        (name, *(f"{one:.3g}" for one in (value, design.reference[name])), f"{design.narrower[name]:.2f}")
        for name, value in design.deviations.items()
    ]
    head = ("parameter", "standard deviation", "with the nutation", "times narrower")
    return ResultTable("design", head, rows)


def fit_table(fits: Mapping[str, ResidualFit]) -> ResultTable:
    """Return the mean squares of the residuals of each hinge, a column for each label."""
    rows = [("all", *(chi2_text(fit.chi2) for fit in fits.values()))]
    rows += [(name, *(chi2_text(fit.hinge_chi2[name]) for fit in fits.values())) for name in HINGES]
    return ResultTable("residuals", ("hinge", *fits), rows)


def bin_table(fit: ResidualFit) -> ResultTable:
    """Return the clearest mean residuals."""
    clearest = sorted(fit.bins, key=lambda one: -abs(one.mean_rad) * one.rows**0.5 / one.rms_rad)
    rows = [
        (
            one.hinge,
            QUANTITIES[one.by],
            f"{one.low:.3g} to {one.high:.3g}",
            str(one.rows),
            f"{1e3 * one.mean_rad:+.3f}",
            f"{1e3 * one.rms_rad:.3f}",
        )
        for one in clearest[:MOST_ROWS]
    ]
    head = ("hinge", "by", "range", "rows", "mean residual mrad", "rms mrad")
    return ResultTable("largest mean residuals", head, rows, 2)


def log_table(logs: Sequence[Log], verdicts: Sequence[LogVerdict]) -> ResultTable:
    """Return length, rows and findings of logs."""
    rows = [
        (
            log.name,
            f"{log.t_s[-1] - log.t_s[0]:.3g}",
            str(len(log)),
            "yes" if verdict.accepted else "**no**",
            "; ".join(f"{one.name} ({one.severity}): {one.where}" for one in verdict.findings) or "none",
        )
        for log, verdict in zip(logs, verdicts, strict=True)
    ]
    return ResultTable(
        "", ("log", "length, s", "rows", "accepted", "findings"), rows, 1, ("accepted", "findings")
    )


def residual_drawing(file: str, fits: Mapping[str, ResidualFit], by: str, title: str) -> Drawing:
    """Return the figure of the mean residuals of each hinge by one of `QUANTITIES`."""
    from spheretwin.viz.figures import twin  # Matplotlib is optional

    panels: dict[str, dict[str, Any]] = {}
    for hinge, name in zip(ANGLES, HINGES, strict=True):
        panels[hinge] = {}
        for label, fit in fits.items():
            bins = [one for one in fit.bins if (one.hinge, one.by) == (name, by)]
            middle = np.array([0.5 * (one.low + one.high) for one in bins])
            panels[hinge][label] = middle, 1e3 * np.array([one.mean_rad for one in bins])
    quantity = QUANTITIES[by]
    caption = f"{title}: mean over ranges of {quantity.partition(',')[0]}, {' and '.join(fits)}."
    return Drawing(file, caption, twin.residuals(panels, quantity, "mean residual, mrad", title))


def write(
    path: Path,
    result: Identified,
    logs: Sequence[Log],
    scenario: str,
    changes: Mapping[str, Any],
    command: str,
    history: Sequence[Identification] = (),
) -> None:
    """Write the page of an identification, one file of HTML; arguments as in `write_twin`, and its history.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    verdict = "accepted" if result.accepted else "not accepted"
    if result.nothing_to_correct:
        verdict += "; the values of the scenario are those of the logs"
    lead = f"Identification of {scenario} from {len(logs)} logs: **{verdict}**."
    loaded = scenarios.load(scenario, dict(changes))
    sections = [
        PageSection("Data", [log_table(logs, [check(log, loaded) for log in logs])]),
        PageSection("Excitation", [_motion_table(logs), *_determined(logs, scenario, changes)]),
        PageSection("Parameters", [parameter_table(result), *_sentences(result)]),
        PageSection("Residuals", _residuals(result)),
        PageSection("Refused", [f"- {line}" for line in _refused(result)] or ["Nothing."]),
        PageSection("What the model may lack", _lacking(result)),
        *([PageSection("History", [history_drawing(history)])] if len(history) > 1 else []),
    ]
    with TemporaryDirectory() as folder:
        _, html = ReportPage("report", "Identification", lead, sections, command).write(Path(folder))
        save_text(path, html.read_text(encoding="utf-8"))


WIDTH_TEXT = (
    "Intervals of 95 %. Widening: width over that which the noise of the sensors alone gives. Above 1,"
    " parameters that were not identified show departures in the residuals, which move the values."
)


def _motion_table(logs: Sequence[Log]) -> ResultTable:
    head = ("log", *(f"{hinge}, °" for hinge in ANGLES), "largest current, A", "rms current, A", "conditions")
    rows = []
    for log in logs:
        degrees, current_A = np.degrees(log.angle_rad), np.nan_to_num(log.current_A)
        rows.append(
            (
                log.name,
                *(f"{np.nanmin(angle):.1f} to {np.nanmax(angle):.1f}" for angle in degrees.T),
                f"{np.max(np.abs(current_A)):.2f}",
                f"{np.sqrt(np.mean(current_A**2)):.2f}",
                ", ".join(f"{name} = {value}" for name, value in log.conditions.items()) or "none",
            )
        )
    return ResultTable("", head, rows, 1, ("conditions",))


def _determined(logs: Sequence[Log], scenario: str, changes: Mapping[str, Any]) -> Iterator[str]:
    for log in logs:
        lines = identifiability(log, scenario, {**changes, **log.conditions})
        yield "\n".join([f"{log.name}:", "", *(f"- {line}." for line in lines)])


def _sentences(result: Identified) -> Iterator[str]:
    """Yield sentences on the widths of the intervals, and on errors that go together, the closest first."""
    if result.covariance is None:
        yield "Nothing was identified."
        return
    yield WIDTH_TEXT
    lines = correlation_sentences(list(result.parameters), result.covariance, _CORRELATED)
    yield (
        "\n".join(f"- {line}." for line in lines) or f"No two errors correlate by more than {_CORRELATED:g}."
    )


def _residuals(result: Identified) -> list[str | ResultTable | Drawing | PageSection]:
    if result.held_out is None or result.held_out_before is None:
        return ["Nothing was identified."]
    fits = dict(zip(LABELS, (result.held_out_before, result.held_out), strict=True))
    text = (
        "Held-out windows: mean square of the residuals over that of the noise, 1 if the model lacks nothing."
    )
    drawings = [
        residual_drawing(f"residuals_{by}.svg", fits, by, "Residuals in held-out windows")
        for by in QUANTITIES
    ]
    return [text, fit_table(fits), *drawings]


def _refused(result: Identified) -> list[str]:
    return [*(f"{', '.join(one.parameters)}: {one.why}." for one in result.refused), *result.shortcomings]


def _lacking(result: Identified) -> list[str | ResultTable | Drawing | PageSection]:
    if not result.suggestions:
        return [f"{NO_SUGGESTION}."]
    text = (
        "Each kind of parameter that was not identified, with its most likely departures from the scenario in"
        " the training windows: rise of the log likelihood of the held-out windows, and their mean square."
    )
    return [text, suggestion_table(result.suggestions)]
