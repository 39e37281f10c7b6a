"""Tolerances of a comparison with a reference run, signal by signal, from a TOML file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib import resources
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from spheretwin.analysis.recorded_run import Reviewed
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, did_you_mean
from spheretwin.models.telemetry.signals import Signal
from spheretwin.scenario.fields import explain
from spheretwin.scenario.reading import read_toml, toml_names
from spheretwin.viz.terminal.reviews import SignalTolerance

FOLDER = resources.files("spheretwin.analysis") / "shipped"

Allowance = Annotated[float, Field(ge=0)]


class Tolerance(BaseModel):
    """Tolerance of one signal; zero by default."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    absolute: Allowance = Field(0.0, description="difference, in the unit of the signal")
    relative: Allowance = Field(
        0.0, description="difference over the reference's magnitude; adds to absolute"
    )
    time_s: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.0, description="largest time by which the reference may have the value earlier or later, s"
    )


class Tolerances(BaseModel):
    """Tolerances by signal; signals that are not named are not compared."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    description: str = Field("", description="purpose and reasons of the tolerances")
    signals: Annotated[dict[str, Tolerance], Field(min_length=1)] = Field(
        description="by the name of the telemetry column"
    )


def shipped() -> list[str]:
    """Return the names of the tolerances of the package."""
    return toml_names(FOLDER)


def load(source: str) -> Tolerances:
    """Load tolerances by a shipped name or from a TOML file.

    Raises
    ------
    InputError
        It cannot be read, or a field is unknown, of the wrong type or out of range.
    """
    fields, _ = read_toml("tolerance", source, FOLDER)
    try:
        return Tolerances.model_validate_json(json.dumps(fields, default=str))
    except ValidationError as error:
        raise InputError(f"tolerance {source}: {_error_text(error, fields)}") from None


def _error_text(error: ValidationError, fields: dict[str, Any]) -> str:
    """Return the first error; for a signal's table, in terms of the fields of that table."""
    match error.errors()[0]["loc"]:
        case ("signals", str() as name, _, *_):
            try:
                Tolerance.model_validate_json(json.dumps(fields["signals"][name], default=str))
            except ValidationError as inner:
                return f"signals.{name}: {explain(inner, Tolerance)}"
    return explain(error, Tolerances)


# A time of whole ticks is exact to rounding only.
WHOLE = 1e-9


class Exceeded(NamedTuple):
    """First violation of a signal's tolerance."""

    path: str
    signal: str
    axis: str
    """Label of the entry; empty for a signal of one number."""
    t_s: float
    by: float
    """Excess over the tolerance, in the unit of the signal; infinite if one of the two has no value."""


def compare(reference: Reviewed, run: Reviewed, tolerances: Tolerances) -> list[SignalTolerance]:
    """Return for each signal the largest share of its tolerance that a run used.

    Where a signal exceeds its tolerance, it is the place of the largest excess.

    Raises
    ------
    InputError
        One of the runs lacks a signal, or they have different control periods.
    """
    return [
        _largest_share(signal, *_columns_of_both(reference, run, signal.name), tolerance, run.period_s)
        for signal, tolerance in _signals(reference, run, tolerances)
    ]


def exceeded(reference: Reviewed, run: Reviewed, tolerances: Tolerances) -> list[Exceeded]:
    """Return the first violation of each signal, the earliest first.

    A value is allowed within ``absolute + relative · |reference|`` of the reference's value at that time,
    or anywhere between its lowest and highest value within ``time_s`` of it. If one of the two has ended and
    the other continues, every signal violates its tolerance.

    Raises
    ------
    InputError
        One of the runs lacks a signal, or they have different control periods.
    """
    violations = []
    for signal, tolerance in _signals(reference, run, tolerances):
        columns = _columns_of_both(reference, run, signal.name)
        if place := _first_violation(*columns, tolerance, reference.period_s):
            tick, entry, by = place
            violations.append(
                Exceeded(str(run.path), signal.name, _axis(signal, entry), tick * run.period_s, by)
            )
    return sorted(violations, key=lambda violation: violation.t_s)


def _signals(
    reference: Reviewed, run: Reviewed, tolerances: Tolerances
) -> Iterator[tuple[Signal, Tolerance]]:
    """Yield each signal with its tolerance."""
    if run.period_s != reference.period_s:
        raise InputError(
            f"review {run.path}: expected a control period of {reference.period_s!r} s as the reference has,"
            f" received {run.period_s!r} s"
        )
    for name, tolerance in tolerances.signals.items():
        signal, other = _find_signal(reference, name), _find_signal(run, name)
        if signal.size != other.size:
            raise InputError(
                f"review {run.path}: expected {name} of {signal.size} numbers, received {other.size}"
            )
        yield signal, tolerance


def _axis(signal: Signal, entry: int) -> str:
    return signal.labels[entry] if signal.labels else ""


class _Band(NamedTuple):
    """Allowed band of values at each tick; infinite to the wrong side where the reference has no value."""

    highest: Array
    lowest: Array
    top: Array
    """Highest value of the reference within the time of the tolerance."""
    bottom: Array


def _band(reference: Array, tolerance: Tolerance, period_s: float) -> _Band:
    allowed = tolerance.absolute + tolerance.relative * np.abs(reference)
    ticks = min(int(tolerance.time_s / period_s + WHOLE), len(reference))
    none = np.isnan(reference)
    upper = [np.where(none, -np.inf, values) for values in (reference + allowed, reference)]
    lower = [np.where(none, np.inf, values) for values in (reference - allowed, reference)]
    if ticks:
        from scipy.ndimage import maximum_filter1d, minimum_filter1d  # slow to import

        window = 2 * ticks + 1
        upper = [maximum_filter1d(values, window, axis=0, mode="nearest") for values in upper]
        lower = [minimum_filter1d(values, window, axis=0, mode="nearest") for values in lower]
    return _Band(upper[0], lower[0], upper[1], lower[1])


def beyond(reference: Array, values: Array, tolerance: Tolerance, period_s: float) -> Array:
    """Return the excess of values over a tolerance, (n, k): 0 within, infinite if either has no value.

    Parameters
    ----------
    reference, values : (n, k) array
        At the same ticks; a NaN is no value.
    tolerance : Tolerance
        Tolerance of the signal.
    period_s : float
        Time between rows, s.
    """
    band = _band(reference, tolerance, period_s)
    with np.errstate(invalid="ignore"):  # infinite from infinite, where a run has diverged
        over = np.maximum(np.maximum(values - band.highest, band.lowest - values), 0.0)
    none = np.isnan(reference)
    return np.where(none & np.isnan(values), 0.0, np.where(np.isnan(over), np.inf, over))


def share_used(reference: Array, values: Array, tolerance: Tolerance, period_s: float) -> Array:
    """Return the share of a tolerance that values use, (n, k): 0 on the reference, 1 at the limit.

    The parameters are those of `beyond`. Beyond a tolerance of zero the share is infinite.
    """
    band = _band(reference, tolerance, period_s)
    with np.errstate(invalid="ignore", divide="ignore"):
        above = (values - band.top) / (band.highest - band.top)
        below = (band.bottom - values) / (band.bottom - band.lowest)
        share = np.where(values > band.top, above, np.where(values < band.bottom, below, 0.0))
    over = beyond(reference, values, tolerance, period_s)
    return np.where(np.isfinite(over), np.where(over > 0, np.maximum(share, 1.0), share), np.inf)


def _largest_share(
    signal: Signal, reference: Array, values: Array, tolerance: Tolerance, period_s: float
) -> SignalTolerance:
    """Return the largest share of a signal, or the largest excess if it exceeds its tolerance."""
    rows = min(len(reference), len(values))
    over = beyond(reference[:rows], values[:rows], tolerance, period_s)
    share = share_used(reference[:rows], values[:rows], tolerance, period_s)
    if len(reference) != len(values):
        return SignalTolerance(signal.name, np.inf, "", rows * period_s, np.inf)
    if not share.size:
        return SignalTolerance(signal.name, 0.0, "", 0.0, 0.0)
    measure = over if over.any() else share
    tick, entry = np.unravel_index(int(np.argmax(measure)), measure.shape)
    return SignalTolerance(
        signal.name,
        float(share[tick, entry]),
        _axis(signal, int(entry)),
        int(tick) * period_s,
        float(over[tick, entry]),
    )


def _first_violation(
    reference: Array, values: Array, tolerance: Tolerance, period_s: float
) -> tuple[int, int, float] | None:
    """Return tick, entry and excess of the first violation; within its tick, of the largest."""
    rows = min(len(reference), len(values))
    over = beyond(reference[:rows], values[:rows], tolerance, period_s)
    if len(ticks := np.flatnonzero(over.any(axis=1))):
        entry = int(np.argmax(over[ticks[0]]))
        return int(ticks[0]), entry, float(over[ticks[0], entry])
    return None if len(reference) == len(values) else (rows, 0, np.inf)


def _columns_of_both(reference: Reviewed, run: Reviewed, name: str) -> tuple[Array, Array]:
    of_reference, of_run = (
        recorded.every_tick[name].reshape(len(recorded.every_tick), -1) for recorded in (reference, run)
    )
    return of_reference, of_run


def _find_signal(run: Reviewed, name: str) -> Signal:
    signals = {signal.name: signal for signal in run.table.signals}
    if name in signals:
        return signals[name]
    raise InputError(
        f"tolerance: expected signals of {run.path}, received {name}{did_you_mean(name, signals)}"
        f" (it has {', '.join(signals)})"
    )
