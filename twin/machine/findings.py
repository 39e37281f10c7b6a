"""Findings of the check of a log: one function and one row each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from spheretwin.machine.diagnosis import FEWEST_WINDOWS, MOST_UNEXPLAINED, Diagnosis
from spheretwin.machine.log import COMMANDED, LARGEST, Log
from spheretwin.machine.model import Model
from spheretwin.machine.row_order import GAP_PERIODS
from spheretwin.machine.torque_balance import TorqueBalance
from spheretwin.models.base.arrays import Array, Booleans
from spheretwin.models.base.errors import InputError, did_you_mean
from spheretwin.models.telemetry.joint_states import ANGLE_NAMES

ERROR, WARNING = "error", "warning"

LOWEST_RATE_Hz = 100.0  # the torque balance needs two samples in its smoothing time and more
SLOWEST_CLOCK_Hz = 20.0  # fewer rows a second are rather a wrong unit of the time
RATE_TOLERANCE = 0.02
MOST_LOST, LONGEST_GAP_s = 0.01, 0.1
JITTER, LARGE_JITTER = 0.05, 0.5
BEYOND_RANGE = 1.2  # sensors have offsets, ends of a range are soft
BEYOND_LIMIT = 5.0
MOST_PERIODS = 1e8  # from the first row to the last, with gaps: a day at 1 kHz
AT_LIMIT, OVER_LIMIT, MOST_AT_LIMIT = 0.99, 1.01, 0.01


class LogFinding(NamedTuple):
    """Finding of a check."""

    name: str
    severity: str
    """``error``: the log is not accepted; ``warning``: it is."""
    where: str
    advice: str


Stated = tuple[str, str, str]
"""Severity, place and advice of a finding."""


@dataclass(frozen=True)
class Evidence:
    """A log, the model of its machine, and what several findings need of both."""

    log: Log
    model: Model

    @cached_property
    def angle_s(self) -> Array:
        """Times of the rows with all angles."""
        return self.log.t_s[_complete(self.log.t_s, self.log.angle_rad)]

    @cached_property
    def streams(self) -> Mapping[str, Array]:
        """Times of the rows of angles and of currents; of the log if they are the same."""
        current_s = self.log.t_s[_complete(self.log.t_s, self.log.current_A)]
        if np.array_equal(self.angle_s, current_s):
            return {"log": self.angle_s}
        return {"angles": self.angle_s, "currents": current_s}

    @cached_property
    def period_s(self) -> float:
        """Median interval of the angles; infinite without two rising times."""
        steps = np.diff(self.angle_s)
        return float(np.median(steps[steps > 0])) if np.any(steps > 0) else np.inf

    @cached_property
    def diagnosis(self) -> Diagnosis | None:
        """Diagnosis by the torque balance; None for a log that is too slow, or has absurd numbers."""
        if self.period_s > 1 / LOWEST_RATE_Hz:
            return None
        angles, currents = (
            _rising(self.log.t_s, values) for values in (self.log.angle_rad, self.log.current_A)
        )
        if len(currents[0]) < 2 or max(np.abs(angles[1]).max(), np.abs(currents[1]).max()) > LARGEST:
            return None
        if not angles[0][-1] - angles[0][0] < MOST_PERIODS * self.period_s:
            return None
        gaps = [gap for t_s in (angles[0], currents[0]) for gap in _gaps(t_s)]
        zero_order_hold = self.log.currents == COMMANDED
        balance = TorqueBalance(*angles, *currents, zero_order_hold, self.model.parameters, gaps)
        return Diagnosis(balance, self.model.delay_s if zero_order_hold else 0.0)


def _complete(t_s: Array, values: Array) -> Booleans:
    return np.isfinite(t_s) & np.all(np.isfinite(values), axis=1)


def _rising(t_s: Array, values: Array) -> tuple[Array, Array]:
    """Return the complete rows that are later than all before."""
    rows = np.flatnonzero(_complete(t_s, values))
    latest = np.maximum.accumulate(t_s[rows])
    rows = rows[np.diff(latest, prepend=-np.inf) > 0]
    return t_s[rows], values[rows]


def _gaps(t_s: Array) -> list[tuple[float, float]]:
    """Return start and end of each interval that is longer than `GAP_PERIODS` periods."""
    steps = np.diff(t_s)
    if not np.any(steps > 0):
        return []
    places = np.flatnonzero(steps > GAP_PERIODS * np.median(steps[steps > 0]))
    return [(float(t_s[place]), float(t_s[place + 1])) for place in places]


def _time_unit(evidence: Evidence) -> Iterator[Stated]:
    rate_Hz = 1 / evidence.period_s
    if 0 < rate_Hz <= SLOWEST_CLOCK_Hz:
        fits = [
            unit for unit, factor in (("ms", 1e3), ("us", 1e6), ("ns", 1e9))
            if LOWEST_RATE_Hz <= factor * rate_Hz <= 1e5
        ]  # fmt: skip
        advice = f"set time.unit to {fits[0]}" if fits else "record at 1000 Hz"
        yield (ERROR, f"t_s: {rate_Hz:.3g} rows per second", f"{advice}; t_s is in seconds")


def _rate(evidence: Evidence) -> Iterator[Stated]:
    rate_Hz, control_Hz = 1 / evidence.period_s, 1 / evidence.model.scenario.controller.period_s
    if SLOWEST_CLOCK_Hz < rate_Hz < LOWEST_RATE_Hz:
        advice = f"record at the control rate, {control_Hz:g} Hz; {LOWEST_RATE_Hz:g} Hz are the least"
        yield (ERROR, f"t_s: {rate_Hz:.4g} Hz", advice)
    elif rate_Hz >= LOWEST_RATE_Hz and rate_Hz < control_Hz * (1 - RATE_TOLERANCE):
        where = f"t_s: {rate_Hz:.4g} Hz, control at {control_Hz:g} Hz"
        yield (WARNING, where, "record each control tick: the currents between the rows are unknown")


def _time_order(evidence: Evidence) -> Iterator[Stated]:
    for name, t_s in evidence.streams.items():
        back = np.flatnonzero(np.diff(t_s) < 0)
        if len(back):
            where = f"{name}: {len(back)} times, first after {t_s[back[0]]:.6g} s"
            yield (
                ERROR,
                where,
                "record with one monotonic clock; state time.wrap for a counter that starts again",
            )
    if lost := np.count_nonzero(~np.isfinite(evidence.log.t_s)):
        yield (ERROR, f"t_s: {lost} rows without a time", "remove these rows")


def _duplicates(evidence: Evidence) -> Iterator[Stated]:
    for name, t_s in evidence.streams.items():
        same = np.flatnonzero(np.diff(t_s) == 0)
        if len(same):
            where = f"{name}: {len(same)} rows, first at {t_s[same[0]]:.6g} s"
            yield (ERROR, where, "remove rows that repeat a time, or record finer times")


def _gap_rows(evidence: Evidence) -> Iterator[Stated]:
    for name, t_s in evidence.streams.items():
        if gaps := _gaps(t_s):
            lengths = [end - start for start, end in gaps]
            longest, share = int(np.argmax(lengths)), sum(lengths) / max(t_s[-1] - t_s[0], 1e-9)
            is_large = share > MOST_LOST or lengths[longest] > LONGEST_GAP_s
            where = (
                f"{name}: {len(gaps)}, {share:.2g} of the time, longest {lengths[longest]:.3g} s"
                f" at {gaps[longest][0]:.6g} s"
            )
            yield (ERROR if is_large else WARNING, where, "record without loss, or cut the log there")


def _jitter(evidence: Evidence) -> Iterator[Stated]:
    for name, t_s in evidence.streams.items():
        steps = np.diff(t_s)
        steps = steps[steps > 0]
        regular = steps[steps <= GAP_PERIODS * np.median(steps)] if len(steps) else steps
        jitter = float(np.std(regular / np.median(steps))) if len(regular) else 0.0
        if jitter > JITTER:
            severity = ERROR if jitter > LARGE_JITTER else WARNING
            where = f"{name}: intervals scatter by {jitter:.2g} of the period"
            yield (severity, where, "take the times from the clock that triggers the converters")


def _missing_values(evidence: Evidence) -> Iterator[Stated]:
    for name, values in (("angles", evidence.log.angle_rad), ("currents", evidence.log.current_A)):
        finite = np.isfinite(values)
        if not np.all(seen := finite.any(axis=0)):
            columns = ", ".join(map(str, np.flatnonzero(~seen)))
            yield (ERROR, f"{name}: no number in column {columns}", "record every column")
        elif partial := np.count_nonzero(finite.any(axis=1) & ~finite.all(axis=1)):
            yield (WARNING, f"{name}: {partial} rows lack some numbers", "these rows are not used")


def _angle_unit(evidence: Evidence) -> Iterator[Stated]:
    low, high = np.transpose(evidence.model.actuator.hinge_range_rad)
    largest = np.nanmax(
        np.abs(np.where(np.isfinite(evidence.log.angle_rad), evidence.log.angle_rad, 0)), axis=0
    )
    bound = BEYOND_RANGE * np.maximum(np.abs(low), np.abs(high))
    in_degrees = _best_is(evidence, "angle_factor")
    if np.any(largest > bound) or in_degrees:
        places = [f"{ANGLE_NAMES[i]} up to {largest[i]:.4g} rad" for i in np.flatnonzero(largest > bound)]
        advice = "set angles.unit to deg" if in_degrees else "set angles.unit, angles.scale and angles.offset"
        where = ", ".join(places) or "angles: in degrees they explain the currents"
        yield (ERROR, where, f"{advice}; hinges turn by {np.degrees(bound[:2].max()) / BEYOND_RANGE:.4g}°")


def _current_unit(evidence: Evidence) -> Iterator[Stated]:
    limit_A, largest = evidence.model.scenario.drive.current_limit_A, _largest_current(evidence)
    if largest > BEYOND_LIMIT * limit_A or _best_is(evidence, "current_factor"):
        where = f"currents: up to {largest:.4g} A, limit {limit_A:g} A"
        yield (ERROR, where, "set currents.unit to mA, or currents.scale")


def _saturation(evidence: Evidence) -> Iterator[Stated]:
    limit_A, largest = evidence.model.scenario.drive.current_limit_A, _largest_current(evidence)
    sizes = np.max(np.abs(np.nan_to_num(evidence.log.current_A)), axis=1)
    share = float(np.mean(sizes >= AT_LIMIT * limit_A))
    if OVER_LIMIT * limit_A < largest <= BEYOND_LIMIT * limit_A and evidence.log.currents == COMMANDED:
        where = f"currents: commands up to {largest:.4g} A, limit {limit_A:g} A"
        yield (ERROR, where, "record measured currents, or command less: the amplifiers limit them")
    elif share > MOST_AT_LIMIT and largest <= BEYOND_LIMIT * limit_A:
        where = f"currents: at the limit of {limit_A:g} A in {share:.2g} of the rows"
        yield (WARNING, where, "move slower or by smaller angles")


def _axes(diagnosis: Diagnosis) -> Iterator[Stated]:
    order, signs = diagnosis.best.order, diagnosis.best.signs
    if (order, signs) != (diagnosis.logged.order, diagnosis.logged.signs):
        texts = [
            f"{ANGLE_NAMES[i]} is {'-' if signs[i] < 0 else ''}{ANGLE_NAMES[order[i]]} of the log"
            for i in range(3)
            if (order[i], signs[i]) != (i, 1)
        ]
        named = [ANGLE_NAMES[place] for place in order]
        advice = f"set angles.columns to those of {', '.join(named)}, angles.sign to {list(signs)}"
        yield (ERROR, "; ".join(texts), advice)


def _groups(diagnosis: Diagnosis) -> Iterator[Stated]:
    order, signs = (values.tolist() for values in diagnosis.best.groups)
    wrong = [j for j, (column, sign) in enumerate(zip(order, signs, strict=True)) if (column, sign) != (j, 1)]
    if wrong:
        texts = [f"{j} is {'-' if signs[j] < 0 else ''}{order[j]} of the log" for j in wrong]
        advice = f"set currents.columns to the order {order}, currents.sign to {signs}"
        yield (ERROR, f"group {', '.join(texts)}", advice)


def _clock_offset(diagnosis: Diagnosis) -> Iterator[Stated]:
    if diagnosis.best.offset_s != diagnosis.logged.offset_s:
        late_s = diagnosis.best.offset_s - diagnosis.logged.offset_s
        where = f"currents: {abs(late_s) * 1e3:.1f} ms {'before' if late_s > 0 else 'after'} the angles"
        yield (ERROR, where, "record both with one clock, or shift the times of one")


def _excitation(diagnosis: Diagnosis) -> Iterator[Stated]:
    if diagnosis.spread < FEWEST_WINDOWS:
        where = f"torque in {diagnosis.spread:.0f} independent windows, {FEWEST_WINDOWS} are the least"
        yield (ERROR, where, "move all axes for some seconds, such as by a multisine of 0.5 to 3 Hz")
    elif diagnosis.decided:
        signs, _ = diagnosis.unverified_axes
        if signs:
            names = ", ".join(ANGLE_NAMES[hinge] for hinge in signs)
            where = f"{names}: too little torque to see a wrong sign"
            yield (WARNING, where, "move these axes, at 0.5 to 3 Hz and by several degrees")


def _unverified(diagnosis: Diagnosis) -> Iterator[Stated]:
    if diagnosis.decided:
        _, pairs = diagnosis.unverified_axes
        texts = [f"order of {ANGLE_NAMES[i]} and {ANGLE_NAMES[j]}" for i, j in pairs]
        if groups := diagnosis.unverified_groups():
            texts.append(f"sign of groups {', '.join(map(str, groups))}")
        if texts:
            advice = "move the axes at different frequencies, also at larger tilts"
            yield (WARNING, "; ".join(texts), advice)


def _torque_balance(diagnosis: Diagnosis) -> Iterator[Stated]:
    if diagnosis.spread >= FEWEST_WINDOWS and not diagnosis.decided:
        where = f"{diagnosis.unexplained:.2g} of the torque is unexplained, {MOST_UNEXPLAINED:g} is the most"
        advice = "check scenario, conditions and columns; record larger motions without external torques"
        yield (ERROR, where, advice)


def _best_is(evidence: Evidence, factor: str) -> bool:
    """True if the reading that explains the log has another unit."""
    diagnosis = evidence.diagnosis
    return diagnosis is not None and getattr(diagnosis.best, factor) != 1.0


def _largest_current(evidence: Evidence) -> float:
    return float(np.max(np.abs(np.nan_to_num(evidence.log.current_A)), initial=0.0))


def _of(finding: Callable[[Diagnosis], Iterator[Stated]]) -> Callable[[Evidence], Iterator[Stated]]:
    """Return a finding of the diagnosis as one of a log: nothing is found without a diagnosis."""
    return lambda evidence: finding(evidence.diagnosis) if evidence.diagnosis else iter(())


FINDINGS: Mapping[str, Callable[[Evidence], Iterator[Stated]]] = {
    "time-unit": _time_unit,
    "rate": _rate,
    "time-order": _time_order,
    "duplicates": _duplicates,
    "gaps": _gap_rows,
    "jitter": _jitter,
    "missing-values": _missing_values,
    "angle-unit": _angle_unit,
    "current-unit": _current_unit,
    "saturation": _saturation,
    "axes": _of(_axes),
    "groups": _of(_groups),
    "clock-offset": _of(_clock_offset),
    "lack-of-excitation": _of(_excitation),
    "unverified": _of(_unverified),
    "torque-balance": _of(_torque_balance),
}
"""Functions by the names of their findings, in the order of the report."""


def check_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of findings, each once.

    Raises
    ------
    InputError
        A name is no finding.
    """
    for name in names:
        if name not in FINDINGS:
            raise InputError(
                f"log check: expected a finding of {', '.join(FINDINGS)}, received {name}"
                f"{did_you_mean(str(name), FINDINGS)}"
            )
    return tuple(dict.fromkeys(names))
