"""Report of one run: facts, the metrics of every run, work, spectrum and events."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from spheretwin.analysis.recorded_run import Reviewed, events, of_the_actuator
from spheretwin.metrics.figures import Figures
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table


def mechanical_work_J(table: Table, period_s: float) -> float | None:
    """Return the work of the coils' torque over a run, ∫ T·ω dt, J; None without a row.

    Torque and rates are those at the ticks, constant from each to the next.

    Parameters
    ----------
    table : Table
        Telemetry.
    period_s : float
        Control period, s.
    """
    if not len(table):
        return None
    power_W = np.einsum("ij,ij->i", table["torque_Nm"], angular_velocity(table["q_rad"], table["qdot_rad_s"]))
    return float(power_W.sum() * period_s)


def angular_velocity(q: Array, qdot: Array) -> Array:
    """Angular velocity of the rotor ``w_SR_S = E(q) qdot``, (n, 3) in rad/s, for many rows at once.

    Parameters
    ----------
    q, qdot : (n, 3) array, rad and rad/s
        Hinge angles and their rates.
    """
    (sa, sb, _), (ca, cb, _) = np.sin(q).T, np.cos(q).T
    da, db, dg = qdot.T
    return np.stack([da + sb * dg, ca * db - sa * cb * dg, sa * db + ca * cb * dg], axis=1)


PEAKS = 3
FEWEST_ROWS = 16

# The window spreads an oscillation over three lines: weaker lines next to it belong to it.
_APART = 2


class SpectralPeak(NamedTuple):
    """An oscillation."""

    frequency_Hz: float
    amplitude: float
    """Amplitude in the unit of the column."""


def peaks(values: Array, period_s: float) -> list[SpectralPeak]:
    """Return the strongest oscillations about the mean, the strongest first, at most three.

    Hann's window. Frequency and amplitude are interpolated between the two lines of the spectrum of which a
    peak consists; exact for a single oscillation.

    Parameters
    ----------
    values : (n,) array
        A column, without gaps.
    period_s : float
        Time between rows, s.
    """
    n = len(values)
    if n < FEWEST_ROWS or not np.all(np.isfinite(values)):
        return []
    lines = _lines(values)
    inner = np.arange(_APART, len(lines) - 1)
    tops = inner[(lines[inner] > lines[inner - 1]) & (lines[inner] >= lines[inner + 1])]
    strongest = tops[np.argsort(-lines[tops], kind="stable")][:PEAKS]
    return [_interpolated_peak(lines, int(top), n, period_s) for top in strongest]


def amplitudes(values: Array, period_s: float) -> tuple[Array, Array]:
    """Return the frequencies above zero, Hz, and at each the amplitude of a single oscillation.

    Parameters
    ----------
    values : (n,) array
        A column; one with gaps, or too short, has no spectrum.
    period_s : float
        Time between rows, s.
    """
    n = len(values)
    if n < FEWEST_ROWS or not np.all(np.isfinite(values)):
        return np.empty(0), np.empty(0)
    lines = _lines(values)
    return np.arange(1, len(lines)) / (n * period_s), 4 * lines[1:] / n


def _lines(values: Array) -> Array:
    """Return the magnitudes of the spectrum of a column about its mean, under Hann's window."""
    n = len(values)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
    return np.abs(np.fft.rfft((values - values.mean()) * window))


def _interpolated_peak(lines: Array, top: int, rows: int, period_s: float) -> SpectralPeak:
    """Return the oscillation with its highest line at `top`, interpolated with the higher neighbour."""
    side = 1 if lines[top + 1] > lines[top - 1] else -1
    ratio = lines[top + side] / lines[top]
    off = (2 * ratio - 1) / (ratio + 1)  # share of a line's distance, to that side
    left = np.sinc(off) / (1 - off * off)  # share of the amplitude, at the line
    return SpectralPeak(float((top + side * off) / (rows * period_s)), float(4 * lines[top] / (rows * left)))


def figures(run: Reviewed) -> dict[str, Any]:
    """Return the report of a run, in JSON types.

    Raises
    ------
    InputError
        Its scenario is not valid in this version, or its model file is missing or has other coil groups.
    """
    try:
        with np.errstate(all="ignore"):  # what damage leaves of numbers may be of any size
            return _figures(run)
    except KeyError as error:
        raise InputError(
            f"review {run.path}: expected facts and rows of a run, received no {shown(error.args[0])}"
        ) from None
    except (ValueError, TypeError, AttributeError, IndexError):
        raise InputError(f"review {run.path}: expected facts and rows of a run, received others") from None


def _figures(run: Reviewed) -> dict[str, Any]:
    scenario = run.record.scenario
    metrics = _metrics(run)
    work_J, copper_J = mechanical_work_J(run.every_tick, run.period_s), metrics["copper_loss_J"]
    return {
        "path": str(run.path),
        "scenario": scenario["name"],
        "law": scenario["controller"]["law"],
        "modelling_error": scenario["plant"]["modelling_error"],
        "load": scenario["disturbance"]["load"],
        "hardware": scenario["hardware"],
        "seed": scenario["seed"],
        "status": run.record.status,
        "reason": _reason(run.table),
        "whole": run.whole,
        "rows": len(run.table),
        "record_rate_Hz": run.rate_Hz,
        "simulated_s": run.simulated_s,
        "planned_s": scenario["duration"],
        **metrics,
        "mechanical_work_J": work_J,
        "energy_J": None if work_J is None or copper_J is None else work_J + copper_J,
        "error_peaks": {
            angle: [{"frequency_Hz": peak.frequency_Hz, "amplitude_rad": peak.amplitude} for peak in of_axis]
            for angle, of_axis in zip(ANGLES, _error_peaks(run), strict=True)
        },
        "events": [{"t_s": t_s, "level": level, "text": text} for t_s, level, text in events(run)],
        "versions": dict(run.record.versions),
    }


def _metrics(run: Reviewed) -> dict[str, Any]:
    scenario, files, *_ = of_the_actuator(run)
    gathered = Figures(PlannedRun(scenario, files.actuator, scenario.ticks))
    gathered.write(run.every_tick)
    return gathered.values()


def _error_peaks(run: Reviewed) -> list[Any]:
    return [peaks(column, run.period_s) for column in run.every_tick["error_rad"].T]


def _reason(table: Table) -> str | None:
    """Return the reason of the watchdog's failsafe state, if it acted."""
    for signal in table.signals:
        if signal.name == "failsafe_reason" and len(table) and table[signal.name][-1] > 0:
            return signal.states[int(table[signal.name][-1])]
    return None
