"""Figure 11: the tilt (60) on the prototype, 0.05 kg on the shaft, under four laws."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.reproduce.experiment import Case, Experiment, Outcomes, Section
from spheretwin.twin.reproduce.figure11 import as_printed, by_change, drawing
from spheretwin.twin.reproduce.figure11.changes import CHANGES
from spheretwin.twin.reproduce.figure11.laws import ALPHA, BETA, COMPARED, printed
from spheretwin.twin.reproduce.running import measured_error
from spheretwin.twin.simulation import Run

RATES = (
    "No sensor of the prototype measures a rate. A wider bandwidth lets more noise through, a narrower one"
    " lags more: the figure has both, for the paper's sinusoid with the noise of the potentiometers. The"
    " runs above have the Kalman filter at its default, unless they say otherwise."
)


def cases() -> list[Case]:
    """Each law as printed, then every single change."""
    return [*map(printed, COMPARED), *(change.case() for change in CHANGES)]


def keep(run: Run) -> NDArray[np.float64]:
    """Largest measured |error| of α and β in each window of the figure, (windows, 2) in rad."""
    error = np.abs(measured_error(run)[:, [ALPHA, BETA]])
    ticks = max(1, round(drawing.WINDOW_s / run.scenario.controller.period_s))
    whole = len(error) // ticks
    return error[: whole * ticks].reshape(whole, ticks, 2).max(axis=1)


def tell(outcomes: Outcomes) -> list[Section]:
    """Errors as printed, what brings each law to the paper's, and the estimators."""
    rates = Section("Where the rates come from", RATES, draw=[drawing.estimators])
    return [as_printed.section(outcomes), by_change.section(outcomes), rates]


EXPERIMENT = Experiment(
    name="figure11",
    title="Figure 11: the tilt on the prototype",
    shows="The motion (60): α rises at π/30 rad/s for 2 s, holds 12° and falls, with 0.05 kg on the shaft and"
    " gravity on; sensors, estimator, electronics and bearings are the prototype's.",
    cases=cases,
    tell=tell,
    keep=keep,
    findings=as_printed.findings,
)
