"""Page of the workflow on a hidden machine: its checks, tables and figures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.machine.report import (
    LABELS,
    design_table,
    log_table,
    parameter_table,
    residual_drawing,
    structure_table,
)
from spheretwin.machine.watching import WatchSettings
from spheretwin.machine.workflow import CHANGED_s, Watched, Workflow
from spheretwin.machine.workflow_checks import TRUE_COLUMNS, checks_of, rms_error, settled_errors
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.pages import markdown
from spheretwin.viz.pages.markdown import Drawing, PageSection, ReportPage, ResultTable

NAME = "twin"
TITLE = "Digital twin of a hidden machine"

CALIBRATED_s = WatchSettings().calibration_s


def figures(result: Workflow) -> dict[str, Any]:
    """Return the results for JSON."""
    return {
        "parameters": {
            name: {"true": result.true[name], "nominal": result.nominal[name], **one._asdict()}
            for name, one in result.identified.parameters.items()
        },
        "refused": result.without_payload.refused,
        "chi2": {"before": result.before.validation.fit.chi2, "after": result.after.validation.fit.chi2},
        "watch": [
            {"change": one.change.label if one.change else None, "alarms": one.alarms}
            for one in result.watched
        ],
    }


def write(folder: Path, result: Workflow, command: str, figure_format: str = "svg") -> list[Path]:
    """Write the page and its figures; return both forms of the page.

    Parameters
    ----------
    folder : Path
        Exists.
    result : Workflow
    command, figure_format : str
        As in `markdown.ReportPage`.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    checks = checks_of(result)
    shadow, residuals, sums = _drawings(result)
    lead = (
        "MuJoCo plays a machine with noisy sensors; its torque, inertia and friction are hidden."
        " A twin that starts from the data sheet designs an experiment, identifies the machine from"
        f" logs of it, follows its state, is validated, and watches it. {markdown.verdict(checks)}"
    )
    sections = [
        PageSection("1. Design", [DESIGN_TEXT, design_table(result.design)]),
        PageSection("2. Logs", [LOGS_TEXT, log_table([one.log for one in result.logs], result.verdicts)]),
        PageSection(
            "3. Identification",
            [
                _identification_text(result),
                parameter_table(result.identified, nominal=result.nominal, true=result.true),
            ],
        ),
        PageSection("4. Shadow", [SHADOW_TEXT, _shadow_rows(result), shadow]),
        PageSection(
            "5. Validation",
            [
                _validation_text(result),
                structure_table(result.before.validation.structure),
                residuals,
            ],
        ),
        PageSection("6. Watch", [WATCH_TEXT, _watch_rows(result), sums]),
        markdown.checks_section(checks),
    ]
    return ReportPage(NAME, TITLE, lead, sections, command).write(folder, figure_format)


DESIGN_TEXT = (
    "`identify --design`: expected standard deviations under the multisine with the largest determinant of"
    " the information, and under the nutation of the same length; both with each known payload."
)
LOGS_TEXT = (
    "`log check`: the designed experiment without and with a known payload, and another motion with another"
    " payload, which judges the twin. The check accepts a log or states what to record instead."
)
SHADOW_TEXT = (
    "`shadow --fit`: errors of the estimated angles and rates against the truth in the log that judges the"
    " twin. The noise of the shadow is fitted to the first second of it: a wrong model needs more"
    " disturbance torque."
)
WATCH_TEXT = (
    "`watch`: the identified twin watches the machine with a payload in the designed motion. The first"
    f" {CALIBRATED_s:g} s measure the noise. The machine changes at a time drawn from the seed,"
    f" {CHANGED_s[0]:g} to {CHANGED_s[1]:g} s after the start. The watch goes on from the size that an alarm"
    " states; a further alarm corrects it."
)

WORDS = (
    "parameter", "hinge", "unit", "change", "named as", "further alarms",
)  # fmt: skip
"""Headings of columns of words; the others are numbers."""


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> ResultTable:
    return ResultTable("", head, list(rows), 0, WORDS)


def _identification_text(result: Workflow) -> str:
    identified = result.identified
    lines = [f"`identify`, from the log without payload: {why}" for why in result.without_payload.reasons]
    if identified.improvement is not None:
        lines.append(f"From both logs: the error of held-out windows is {identified.improvement:.0%} smaller")
    lines += [*identified.correlations, *(f"Not accepted: {why}" for why in identified.reasons)]
    return "\n\n".join(f"{line}." for line in lines)


def _shadow_rows(result: Workflow) -> ResultTable:
    head = ["hinge"]
    columns = []
    for label, judged in zip(LABELS, (result.before, result.after), strict=True):
        for name, quantity, unit in zip(TRUE_COLUMNS, ("angle", "rate"), ("mrad", "mrad/s"), strict=True):
            error, half = settled_errors(result, judged, name)
            head += [f"{quantity} {label.split()[0]}, rms {unit}", "within its 95 % band"]
            columns += [
                [f"{1e3 * value:.3g}" for value in rms_error(result, judged, name)],
                [f"{100 * share:.0f} %" for share in np.mean(np.abs(error) <= half, axis=0)],
            ]
    return _table(head, zip(ANGLES, *columns, strict=True))


def _validation_text(result: Workflow) -> str:
    before, after = result.before.validation, result.after.validation
    wrong = [len(one.structure) for one in (before, after)]
    return (
        "`validate`: the mean square of the residuals over that of the noise, in the log that has not"
        f" identified the twin, is {before.fit.chi2:.2f} before and {after.fit.chi2:.2f} after it."
        f" Parameters that the residuals show to be wrong: {wrong[0]} before, {wrong[1]} after. The table has"
        " the five clearest before. Each is tested alone, so a wrong torque also shows as others."
    )


def _watch_rows(result: Workflow) -> ResultTable:
    head = ("change", "named as", "true size", "size", "unit", "after, s", "confidence", "further alarms")
    return _table(head, map(_watch_row, result.watched))


def _watch_row(watched: Watched) -> tuple[str, ...]:
    change, named = watched.change, watched.named
    further = [one for one in watched.alarms if one is not named]
    alarms = "; ".join(
        f"{one.what}{'' if one.size is None else f' {one.size:+.2g}'} at {one.t_s:.2f} s" for one in further
    )
    if change is None:
        return "none", "–", "–", "–", "–", "–", "–", alarms or "none"
    size = f"{change.size:+.3g}"
    if named is None:
        return change.label, "**not named**", size, "–", "–", "–", "–", alarms or "none"
    return (
        change.label,
        named.what,
        size,
        "–" if named.size is None else f"{named.size:+.3g}",
        named.unit,
        f"{named.t_s - change.t_s:.2f}",
        f"{named.confidence:.3f}",
        alarms or "none",
    )


def _drawings(result: Workflow) -> list[Drawing]:
    from spheretwin.viz.figures import twin  # Matplotlib is optional

    times = result.logs[-1].log.t_s
    columns: dict[str, dict[str, twin.ErrorTrace]] = {"angle, mrad": {}, "rate, mrad/s": {}}
    for label, judged in zip(LABELS, (result.before, result.after), strict=True):
        for quantity, name in zip(columns, TRUE_COLUMNS, strict=True):
            error, half = settled_errors(result, judged, name)
            columns[quantity][label] = twin.ErrorTrace(times[-len(error) :], 1e3 * error, 1e3 * half)
    fits = {
        label: one.validation.fit for label, one in zip(LABELS, (result.before, result.after), strict=True)
    }
    panels = {
        one.change.label if one.change else "no change": twin.Sums(
            one.t_s[one.t_s > CALIBRATED_s],
            {what: values[one.t_s > CALIBRATED_s] for what, values in one.sums.items()},
            one.named.what if one.named else None,
            one.change.t_s if one.change else None,
            [alarm.t_s for alarm in one.alarms],
        )
        for one in result.watched
    }
    threshold = result.watched[0].threshold
    return [
        Drawing(
            "twin_shadow.svg",
            "Errors of the estimated angles and rates over time, before and after identification, with 95 %"
            " bands.",
            twin.errors(columns, ANGLES, "Shadow: errors against the truth"),
        ),
        residual_drawing("twin_residuals.svg", fits, "rate_rad_s", "Validation: residuals"),
        Drawing(
            "twin_watch.svg",
            "Logarithm of the evidence of each change over time, linear up to the threshold and logarithmic"
            " above; after an alarm it starts again from 0. The evidence of all changes together raises an"
            " alarm.",
            twin.sums(panels, threshold, "Watch: evidence of changes"),
        ),
    ]
