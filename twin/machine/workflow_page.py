"""Page of the workflow on a hidden machine: its checks against the truth, tables and figures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.machine.intervals import Z95
from spheretwin.machine.report import (
    LABELS,
    design_table,
    log_table,
    parameter_table,
    residual_drawing,
    structure_table,
)
from spheretwin.machine.validation import CHI2
from spheretwin.machine.watching import WatchSettings
from spheretwin.machine.workflow import CHANGED_s, Judged, Watched, Workflow
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.checks import Check
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.pages import markdown
from spheretwin.viz.pages.markdown import Drawing, PageSection, ReportPage, ResultTable

SETTLED_s = 0.3
"""Time after which the shadow is judged: it starts without knowing the state."""

TRUE_COLUMNS = {"q_estimated_rad": "q_rad", "qdot_estimated_rad_s": "qdot_rad_s"}
"""True values of the estimates that are judged."""


def settled_errors(result: Workflow, judged: Judged, name: str) -> tuple[Array, Array]:
    """Return errors of an estimate against the truth, and their 95 % half-widths, once it has settled."""
    played, table = result.logs[-1], judged.shadowed.telemetry
    first = int(np.searchsorted(played.log.t_s, played.log.t_s[0] + SETTLED_s))
    return (table[name] - played.telemetry[TRUE_COLUMNS[name]])[first:], Z95 * table[f"{name}_std"][first:]


def checks_of(result: Workflow) -> list[Check]:
    """Return the checks of the results."""
    identified, held_out = result.identified, result.identified.held_out
    rate = [rms_error(result, judged, "qdot_estimated_rad_s") for judged in _by_label(result).values()]
    bands = [
        np.abs(error) > half
        for error, half in (settled_errors(result, result.after, n) for n in TRUE_COLUMNS)
    ]
    named = [(one.change, one.named) for one in result.watched if one.change and one.named]
    delays = [alarm.t_s - change.t_s for change, alarm in named]
    sizes = [abs(alarm.size / change.size - 1) for change, alarm in named if alarm.size]
    changes = [one for one in result.watched if one.change]
    separated = ["torque_scale", "plant.modelling_error"]
    false = sum(len(one.others) for one in result.watched)
    return [
        Check(
            "design",
            "expected intervals of torque scale and inertia over those with the nutation, the widest",
            result.design.tried,
            max(1 / result.design.narrower[name] for name in separated),
            0.5,
            "at least two times narrower; friction, which any steady motion shows, is only reported",
        ),
        Check(
            "logs",
            "logs that the check does not accept",
            len(result.verdicts),
            sum(not one.accepted for one in result.verdicts),
            0,
            "nothing is derived from a log with an error",
        ),
        Check(
            "refusal",
            "identifications without a known payload that are accepted",
            1,
            int(result.without_payload.accepted),
            0,
            "currents and angles alone cannot separate torque, inertia and friction",
        ),
        Check(
            "found values",
            "distance from the true value over half of the 95 % interval, the largest",
            len(result.true),
            max((_distance(result, name) for name in identified.parameters), default=float("nan")),
            2.05,
            "four standard deviations",
        ),
        Check(
            "held-out windows",
            "mean square of the residuals over that of the noise",
            1,
            held_out.chi2 if held_out else float("nan"),
            CHI2[1],
            "the twin explains what it has not seen",
            at_least=CHI2[0],
        ),
        Check(
            "rates of the shadow",
            "rms error after identification over that before, the largest of three hinges",
            len(result.logs[-1].log),
            float(np.max(rate[1] / rate[0])),
            1.0,
            "a better model needs less disturbance torque, and gives better rates",
        ),
        Check(
            "bands of the shadow",
            "share of errors of angles and rates outside of their 95 % bands",
            len(result.logs[-1].log),
            float(np.mean(bands)),
            0.1,
            "5 % expected; neighbouring rows are not independent",
        ),
        Check(
            "validation",
            "mean square of the residuals of another motion over that of the noise",
            len(result.logs[-1].log),
            result.after.validation.fit.chi2,
            CHI2[1],
            "noise explains the residuals",
            at_least=CHI2[0],
        ),
        Check(
            "structure",
            "parameters of which the residuals still show a change",
            len(result.logs[-1].log),
            len(result.after.validation.structure),
            0,
            "each is reported by chance once in a hundred validations at most",
        ),
        Check(
            "named changes",
            "changes of the machine that no alarm names",
            len(changes),
            sum(one.named is None for one in changes),
            0,
            "what changed is what an alarm is for",
        ),
        Check(
            "delay of the alarms",
            "time from a change to the alarm that names it, the largest",
            len(changes),
            max(delays, default=float("nan")),
            0.8,
            "a change is named within some windows of 0.1 s",
            "s",
        ),
        Check(
            "sizes of the changes",
            "difference from the true size over it, the largest",
            len(changes),
            max(sizes, default=float("nan")),
            0.4,
            "an alarm comes as soon as a change is certain, with some tenths of a second of data",
        ),
        Check(
            "false alarms",
            "alarms without a change, or that name something else first",
            len(result.watched),
            false,
            0,
            "fewer than one in ten hours are expected",
        ),
    ]


def rms_error(result: Workflow, judged: Judged, name: str) -> Array:
    """Return the rms error of each hinge."""
    error, _ = settled_errors(result, judged, name)
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)))


def _distance(result: Workflow, name: str) -> float:
    """Return the distance of a found value from the true one over half of its interval."""
    value, (low, high), *_ = result.identified.parameters[name]
    return 2 * abs(value - result.true[name]) / (high - low)


def _by_label(result: Workflow) -> dict[str, Judged]:
    return dict(zip(LABELS, (result.before, result.after), strict=True))


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
        PageSection("6. Watch", [WATCH_TEXT, _table(WATCH_HEAD, map(_watch_row, result.watched)), sums]),
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

WATCH_HEAD = ("change", "named as", "true size", "size", "unit", "after, s", "confidence", "further alarms")
WORDS = ("parameter", "hinge", "unit", "change", "named as", "further alarms")
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
    for label, judged in _by_label(result).items():
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


def _watch_row(watched: Watched) -> list[str]:
    change, named = watched.change, watched.named
    further = [one for one in watched.alarms if one is not named]
    alarms = "; ".join(
        f"{one.what}{'' if one.size is None else f' {one.size:+.2g}'} at {one.t_s:.2f} s" for one in further
    )
    row = [change.label if change else "none", *["–"] * 6, alarms or "none"]
    if change:
        row[1:3] = named.what if named else "**not named**", f"{change.size:+.3g}"
    if change and named:
        size = "–" if named.size is None else f"{named.size:+.3g}"
        row[3:7] = size, named.unit, f"{named.t_s - change.t_s:.2f}", f"{named.confidence:.3f}"
    return row


def _drawings(result: Workflow) -> list[Drawing]:
    from spheretwin.viz.figures import twin  # Matplotlib is optional

    times = result.logs[-1].log.t_s
    columns: dict[str, dict[str, twin.ErrorTrace]] = {"angle, mrad": {}, "rate, mrad/s": {}}
    for label, judged in _by_label(result).items():
        for quantity, name in zip(columns, TRUE_COLUMNS, strict=True):
            error, half = settled_errors(result, judged, name)
            columns[quantity][label] = twin.ErrorTrace(times[-len(error) :], 1e3 * error, 1e3 * half)
    fits = {label: one.validation.fit for label, one in _by_label(result).items()}
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
