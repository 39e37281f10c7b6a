"""Figure 11: the tilt with the prototype's electronics, with the printed gains and with single changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from spheretwin.paper import page
from spheretwin.paper.experiment import Array, Experiment, Finding, Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.runner import measured_error
from spheretwin.paper.tilt_cases import BY_LAW, CHANGES, TILT_LAWS, Change, TiltLaw, cases, printed
from spheretwin.run import Run
from spheretwin.viz.pages.markdown import Drawing

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
    return page.window_maxima(error, WINDOW_s, run.scenario.controller.period_s)


def errors_drawing(windows: Mapping[str, Sequence[Array]]) -> Drawing:
    """Measured |error| of α and β over time.

    Parameters
    ----------
    windows : mapping of law to (windows, 2) arrays, rad
        One for each seed.
    """
    from spheretwin.viz.figures import over_time as figures

    courses = {
        f"{BY_LAW[law].label} ({paper_text(BY_LAW[law])})": figures.ErrorCourse(
            law, np.degrees(page.padded(of_seeds)), BY_LAW[law].paper_deg or 0.0, BY_LAW[law].paper_axes
        )
        for law, of_seeds in windows.items()
    }
    figure = figures.courses(
        courses, WINDOW_s, ("α", "β"), "Tilt with the prototype's electronics: measured error"
    )
    caption = (
        f"Largest measured |error| within each {1e3 * WINDOW_s:g} ms: median over the seeds, and their range"
        " as a band. Dotted, and in the legend: the largest error of α in the paper's figure."
    )
    return Drawing("figure11_errors.svg", caption, figure)


def paper_text(law: TiltLaw) -> str:
    """Printed value of a law, or the source of its gains if the paper does not have it."""
    return f"paper {law.paper}°" if law.paper_deg else law.gains


def changes_drawing(by_law: Mapping[str, Mapping[str, Errors]]) -> Drawing:
    """Largest error of α under every single change, by law and change."""
    from spheretwin.viz.figures import over_time as figures

    groups = [
        figures.ErrorGroup(
            law,
            BY_LAW[law].label,
            [
                figures.ErrorLine(label, np.degrees(measured), np.degrees(true))
                for label, (measured, true) in errors.items()
            ],
            BY_LAW[law].paper_deg,
        )
        for law, errors in by_law.items()
    ]
    figure = figures.lines(groups, "largest |error| of α, degrees", "One change at a time")
    caption = "Largest |error| of α: median over the seeds, and range. Filled: measured. Hollow: true."
    return Drawing("figure11_changes.svg", caption, figure)


def estimators_drawing() -> Drawing:
    """Errors and lags of the estimators over their bandwidths."""
    from spheretwin.control.estimators.noise_and_lag import compare
    from spheretwin.viz.figures import conditions as figures

    curves = {kind: figures.Curve(*result) for kind, result in compare(BANDWIDTHS_rad_s.tolist()).items()}
    figure = figures.estimators(BANDWIDTHS_rad_s, curves, "Rates of the paper's sinusoid from noisy angles")
    caption = "RMS error and lag of the estimated rate against the estimator's bandwidth, 0.02° rms of noise."
    return Drawing("figure11_estimators.svg", caption, figure)


MEASURED = (
    "The paper's figure shows errors of sensors, so this figure has the *measured* error; the table also has"
    " the true one. The nonlinearity of a potentiometer and the offset of its converter add to the true error"
    " alone, noise to the measured error alone. The encoder of γ has steps of 0.18°, which hide its error. PD"
    " has no integral and sags under the mass. In the paper its error of β is as large as that of α; here no"
    " torque acts on β."
)
PRINTED_HEAD = (
    "law", "gains", "status", "paper", "α measured", "β measured", "α true", "β true", "γ true",
)  # fmt: skip


def printed_section(outcomes: Outcomes) -> Section:
    """Errors of the laws next to the paper's, and their course."""
    of_laws = [(law, runs) for law in TILT_LAWS if (runs := outcomes.runs(printed(law)))]
    title = "Largest |error| over the run in degrees: median over the seeds, and range"
    windows = {law.law: [run.data for run in runs] for law, runs in of_laws}
    table = [_printed_row(law, runs) for law, runs in of_laws]
    order = "".join(f" T{finding.text.removeprefix('t')}." for finding in _order(outcomes))
    return Section(
        "The laws as printed",
        f"{MEASURED}{order}",
        [ResultTable(title, PRINTED_HEAD, table, 3)],
        [lambda: errors_drawing(windows)] if windows else [],
    )


def _printed_row(law: TiltLaw, runs: Sequence[Outcome]) -> tuple[str, ...]:
    measured = [page.spread_deg(page.of_axis(runs, "measured_max_abs_error", axis)) for axis in (ALPHA, BETA)]
    true = [page.spread_deg(page.of_axis(runs, "max_abs_error", axis)) for axis in range(3)]
    return law.label, law.gains, page.statuses_text(runs), law.paper, *measured, *true


def findings(outcomes: Outcomes) -> list[Finding]:
    """Compare order and sizes of the errors with the paper's."""
    return [*_order(outcomes), *_sizes(outcomes)]


def _order(outcomes: Outcomes) -> list[Finding]:
    """Compare the order of the laws with the paper's, seed by seed."""
    of_paper = [law for law in TILT_LAWS if law.paper_deg]
    runs = [outcomes.runs(printed(law)) for law in of_paper]
    if not all(runs):
        return []
    errors = np.array([page.of_axis(of_law, "measured_max_abs_error", ALPHA) for of_law in runs])
    right, seeds = int(np.sum(np.all(np.diff(errors, axis=0) < 0, axis=0))), errors.shape[1]
    order = " > ".join(law.label for law in of_paper)
    text = f"the paper's order, {order}, holds for α under {right} of {seeds} seeds"
    return [Finding(right == seeds, text)]


def _sizes(outcomes: Outcomes) -> list[Finding]:
    """Compare the measured errors of α with the paper's."""
    texts, reproduced = [], True
    for law in TILT_LAWS:
        runs = outcomes.runs(printed(law))
        if not law.paper_deg or not runs:
            continue
        median = float(np.degrees(np.median(page.of_axis(runs, "measured_max_abs_error", ALPHA))))
        reproduced = reproduced and median <= REACHED * law.paper_deg
        texts.append(f"{law.label} {median:.2f}° (paper {law.paper})")
    if not texts:
        return []
    why = "" if reproduced else "; its chapter lists the single changes with which a law reaches it"
    return [Finding(reproduced, f"largest measured error of α: {', '.join(texts)}{why}")]


ONE_THING = (
    "Each row changes one thing. The values come from scans: the gain with the paper's error, or the value"
    " with the least error if none has it, as of corners and estimators. *Reached* means that the median over"
    f" the seeds is at most {REACHED:g} times the paper's figure, which is read from a plot; *by the true"
    " error* means that the measured error does not reach it. On ideal hardware (true angles and rates, no"
    " delay, no friction, coils with the lag L/R alone) the remaining error comes from the corners of the"
    " reference: its rate jumps, and no law has a feed-forward of the acceleration. A better estimator or"
    " true rates do not reduce it."
)
CHANGE_HEAD = ("law", "single change", "reaches the paper", "paper", "α measured", "α true")


def change_section(outcomes: Outcomes) -> Section:
    """Errors under every single change."""
    by_change = [(change, _alpha(runs)) for change in CHANGES if (runs := outcomes.runs(change.case()))]
    title = "Largest |error| of α in degrees: median over the seeds, and range"
    table = [_change_row(change, errors) for change, errors in by_change]
    return Section(
        "What brings each law to the paper's figure",
        f"{ONE_THING}{_sufficient_changes(by_change)}",
        [ResultTable(title, CHANGE_HEAD, table, 3)],
        [lambda: changes_drawing(_by_law(outcomes, by_change))] if by_change else [],
    )


def reached(law: TiltLaw, measured: Array, true: Array) -> str:
    """State if a law reaches the paper's figure, from the errors (rad) of all seeds."""
    if law.paper_deg is None:
        return page.NONE
    limit = REACHED * np.radians(law.paper_deg)
    if np.median(measured) <= limit:
        return "yes"
    return "by the true error" if np.median(true) <= limit else "no"


def _change_row(change: Change, errors: Errors) -> tuple[str, ...]:
    law = BY_LAW[change.law]
    return law.label, change.label, reached(law, *errors), law.paper, *map(page.spread_deg, errors)


def _sufficient_changes(by_change: Sequence[tuple[Change, Errors]]) -> str:
    """List the changes of each law that reach the paper's figure with the prototype's electronics."""
    labels: dict[str, list[str]] = {}
    for change, errors in by_change:
        law = BY_LAW[change.law]
        if not change.ideal and reached(law, *errors) == "yes":
            labels.setdefault(law.label, []).append(change.label)
    text = "; ".join(f"{law} by {' or '.join(of_law)}" for law, of_law in labels.items())
    return f" What brings a law there with these electronics: {text}." if text else ""


def _by_law(outcomes: Outcomes, by_change: Sequence[tuple[Change, Errors]]) -> dict[str, dict[str, Errors]]:
    """Errors of each law as printed, and under each change."""
    by_law: dict[str, dict[str, Errors]] = {}
    for law in TILT_LAWS:
        runs = outcomes.runs(printed(law))
        errors = {"unchanged": _alpha(runs)} if runs else {}
        errors |= {change.label: of_change for change, of_change in by_change if change.law == law.law}
        if errors:
            by_law[law.law] = errors
    return by_law


def _alpha(runs: Sequence[Outcome]) -> Errors:
    return page.of_axis(runs, "measured_max_abs_error", ALPHA), page.of_axis(runs, "max_abs_error", ALPHA)


RATES = (
    "No sensor of the prototype measures a rate. A wider bandwidth passes more noise, a narrower one has a"
    " larger lag: the figure shows both for the paper's sinusoid with the noise of the potentiometers. The"
    " runs above use the Kalman filter with its default bandwidth, unless a row states another one."
)


def sections(outcomes: Outcomes) -> list[Section]:
    """Errors as printed, the changes, and the estimators."""
    rates = Section("Where the rates come from", RATES, drawings=[estimators_drawing])
    return [printed_section(outcomes), change_section(outcomes), rates]


EXPERIMENT = Experiment(
    name="figure11",
    title="Figure 11: the tilt with the prototype's electronics",
    summary="The motion (60): α rises at π/30 rad/s for 2 s, holds 12° and falls, with 0.05 kg on the shaft"
    " and gravity on; sensors, estimator, electronics and bearings are the prototype's.",
    cases=cases,
    sections=sections,
    reduce=reduce,
    findings=findings,
)
