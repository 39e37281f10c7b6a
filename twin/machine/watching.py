r"""Watch over a machine: alarms when its parameters change, with a stated rate of false alarms.

The log is judged in short windows. Each starts from the estimate of the shadow; a change of a parameter by δ
would change the residuals by Jδ, and an error ρ of the twin by Jρ. The log likelihood ratio of the two is
(δ − ρ) g − ½ (δ² − ρ²) h with ``g = −Jᵀr, h = JᵀJ``. A cumulative sum (CUSUM) of the ratios of each
parameter, up and down, raises an alarm above a threshold; so does a sum for a doubled variance, for changes
without a name. If nothing has changed and the error of the twin is at most ρ, such a sum exceeds a threshold
η on average not before e^η windows (Lorden 1971), which gives the threshold for a rate of alarms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log as logarithm
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.machine.log import Log, joined
from spheretwin.machine.parameters import Kind, Machine, Parameter, selected
from spheretwin.machine.state_estimation import Shadow
from spheretwin.machine.windows import Part, Shooting, Window
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.fields import SettingsModel

Array = NDArray[np.float64]

WATCHED = ("torque_scale", "plant.group_gain", "plant.coulomb_Nm", "sensors.angle_offset_rad")
"""Parameters that are watched unless others are named."""

UNNAMED = "unexplained"


class WatchSettings(SettingsModel):
    """Settings of a watch."""

    window_s: Annotated[float, Field(gt=0, le=60)] = Field(0.1, description="length of a window, s")
    false_alarms_per_hour: Annotated[float, Field(gt=0, le=3600)] = Field(
        0.1, description="largest mean rate of alarms without a change, 1/h"
    )
    calibration_s: Annotated[float, Field(ge=0, le=3600)] = Field(
        2.0,
        description="time at the start in which the machine is as the twin; its noise is measured then, s",
    )


class Alarm(NamedTuple):
    """Alarm of a watch."""

    t_s: float
    what: str
    """Name of a parameter, or ``unexplained``."""
    size: float | None
    """Change since its onset, in the unit of the parameter."""
    unit: str
    confidence: float
    """Posterior share of this parameter among all that are watched, each alone, with equal priors."""

    def text(self) -> str:
        """Return the alarm as a line."""
        size = "" if self.size is None else f" {self.size:+.3g}{'' if self.unit == '1' else f' {self.unit}'}"
        return f"{self.what}{size}, confidence {self.confidence:.1%}"


class JudgedWindow(NamedTuple):
    """A window that a watch has judged."""

    t_s: float
    """Its end."""
    chi2: float
    """Mean square of its residuals over that of the noise."""
    evidence: float
    """Largest cumulative sum over the threshold: an alarm is due from 1."""


class Watch:
    """Watch over a log or a stream.

    Parameters
    ----------
    scenario : str
        Name or file of the scenario of the machine.
    changes : mapping
        Its fields, such as those of a twin.
    parameters : sequence of str
        Names of the parameters that are watched.
    settings : WatchSettings, optional

    Attributes
    ----------
    threshold : float
        Of the cumulative sums.
    judged : list of JudgedWindow
        Windows of the last call of `advance`.

    Raises
    ------
    InputError
        The scenario or a parameter cannot be used.
    """

    def __init__(
        self,
        scenario: str,
        changes: dict[str, object] | None = None,
        parameters: Sequence[str] = WATCHED,
        settings: WatchSettings | None = None,
    ) -> None:
        self.settings = settings or WatchSettings()
        self._machine = Machine(scenario, changes or {})
        self._parameters = selected(parameters, self._machine.model.actuator)
        if not self._parameters:
            raise InputError("watch: expected at least one parameter, received none")
        self._values = np.array([self._machine.nominal(parameter) for parameter in self._parameters])
        self._candidates = list(_candidates(self._parameters))
        self._directions = np.array([one.direction for one in self._candidates])
        sizes = np.array([one.size for one in self._candidates])
        self._changes = np.concatenate([sizes, -sizes])
        self._errors = TOLERATED * self._changes
        sums = 2 * len(sizes) + 1
        windows_per_hour = 3600 / self.settings.window_s
        self.threshold = logarithm(sums * windows_per_hour / self.settings.false_alarms_per_hour)
        self.judged: list[JudgedWindow] = []
        self._shadow = Shadow(self._machine.model)
        self._rows: Log | None = None
        self._place = 1  # row of the shadow
        self._period_s = self._calibrated_s = 0.0
        self._skipped = 0  # windows that are not judged
        self._calibration: list[tuple[float, int]] = []  # squares and angles of a window
        self._variance = 1.0
        self._sums = self._reached = np.zeros(sums)
        self._since = np.zeros((sums, 2))  # of each sum above 0: its gradient and information
        self._waited = 0  # windows since a sum exceeded the threshold
        self._likely: Alarm | None = None  # alarm of the last of them

    @property
    def variance(self) -> float:
        """Variance of the residuals over that of the sensors' noise, measured at the start; at least 1."""
        return self._variance

    @property
    def sums(self) -> dict[str, float]:
        """Cumulative sum of each change after the last window, the larger of up and down, not yet reset."""
        largest = self._reached[:-1].reshape(2, -1).max(axis=0)
        names = [candidate.name for candidate in self._candidates]
        return {**dict(zip(names, largest.tolist(), strict=True)), UNNAMED: float(self._reached[-1])}

    def advance(self, log: Log) -> list[Alarm]:
        """Judge the next rows, as far as they fill windows; return new alarms in order.

        Raises
        ------
        InputError
            The rows do not fit the machine or those before.
        """
        rows = log if self._rows is None else joined([self._rows, log])
        self.judged = []
        if not self._period_s:
            if len(rows) <= _ROWS_BEFORE:
                self._rows = rows
                return []
            self._shadow.advance(rows.rows(0, 2))
            self._period_s = float(np.median(np.diff(rows.t_s[:_ROWS_BEFORE])))
            self._calibrated_s = float(rows.t_s[0]) + self.settings.calibration_s
        period_s, alarms = self._period_s, []
        count = max(round(self.settings.window_s / period_s), 10)
        while self._place + count < len(rows):
            end = self._place + count
            times = np.diff(rows.t_s[self._place : end + 1])
            mean, covariance = self._shadow.motion()
            estimated = self._shadow.advance(rows.rows(self._place + 1, end + 1))
            if not np.all(np.abs(times - period_s) < 0.2 * period_s):  # a gap, with unknown currents
                self._skipped = _AFTER_GAP
            elif self._skipped:
                self._skipped -= 1
            else:
                rate_rad_s = estimated["qdot_estimated_rad_s"]
                window = Window(rows, self._machine, self._place, count, mean, rate_rad_s)
                part = self._part(window, covariance)
                t_s = float(rows.t_s[end])
                alarms += self._judge(part, t_s)
                chi2 = part.squares / (part.used * self._variance)
                self.judged.append(JudgedWindow(t_s, chi2, float(self._reached.max()) / self.threshold))
            self._place = end
        spare = max(self._place - _ROWS_BEFORE, 0)
        self._rows, self._place = rows.rows(spare, len(rows)), self._place - spare
        return alarms

    def _part(self, window: Window, covariance: Array) -> Part:
        # Within a count the shadow's distribution is not normal: its errors last from window to window.
        covariance[range(3), range(3)] += self._machine.model.half_count_rad**2 / 3
        (part,) = Shooting([window], self._parameters, [covariance]).parts(self._values, slopes=True)
        return part

    def _judge(self, part: Part, t_s: float) -> list[Alarm]:
        """Judge a window that ends at a time; return new alarms."""
        if t_s < self._calibrated_s:
            self._calibration.append((part.squares, part.used))
            return []
        if self._calibration:
            squares, used = np.sum(self._calibration, axis=0)
            self._variance = max(1.0, float(squares / used))
            self._calibration = []
        return self._add(part, t_s)

    def _add(self, part: Part, t_s: float) -> list[Alarm]:
        """Add a window to the sums."""
        gradient = -self._directions @ part.gradient / self._variance
        information = (
            np.einsum("ci,ij,cj->c", self._directions, part.information, self._directions) / self._variance
        )
        both, twice = np.tile(gradient, 2), np.tile(information, 2)
        ratios = (self._changes - self._errors) * both - 0.5 * (self._changes**2 - self._errors**2) * twice
        # A doubled variance of n residuals with the sum of squares S: -n/2 ln 2 + S/4.
        unnamed = part.squares / (4 * self._variance) - 0.5 * part.used * logarithm(2.0)
        self._since[self._sums == 0] = 0.0
        self._since[:-1] += np.stack([both, twice], axis=1)
        self._sums = self._reached = np.maximum(self._sums + np.append(ratios, unnamed), 0.0)
        exceeds = self._sums.max() >= self.threshold
        if exceeds:
            self._likely = self._alarm(t_s)
        if self._likely is None:
            return []
        alarm = self._likely._replace(t_s=t_s)
        if exceeds and self._awaits(alarm):
            self._waited += 1
            return []
        self._sums, self._waited, self._likely = np.zeros_like(self._sums), 0, None
        self._adopt(alarm)
        return [alarm]

    def _awaits(self, alarm: Alarm) -> bool:
        """True if the next window may tell better what has changed."""
        least = _LEAST_WINDOWS if self._lasts(alarm) else 0
        return self._waited < least or (alarm.confidence < _CERTAIN and self._waited < _MOST_WINDOWS)

    @staticmethod
    def _lasts(alarm: Alarm) -> bool:
        """True if all later windows show the change: the shadow adopts an offset in the first one."""
        return alarm.what != UNNAMED and not alarm.what.startswith("sensors.")

    def _adopt(self, alarm: Alarm) -> None:
        """Go on from the changed machine."""
        for candidate in self._candidates:
            if candidate.name == alarm.what and alarm.size and self._lasts(alarm):
                least = np.array([parameter.kind.least for parameter in self._parameters])
                self._values = np.maximum(self._values + alarm.size * candidate.direction, least)

    def _alarm(self, t_s: float) -> Alarm:
        """Return the alarm of the most likely change."""
        gradient, information = self._since[:-1].T
        width = (_PLAUSIBLE * self._changes) ** 2
        # Evidence for a change whose size is distributed normally about 0 with this variance.
        scores = 0.5 * gradient**2 / (information + 1 / width) - 0.5 * np.log1p(information * width)
        scores = np.append(np.where(self._sums[:-1] > 0, scores, -np.inf), self._sums[-1])
        confidence = float(1 / np.sum(np.exp(scores - scores.max())))
        best = int(np.argmax(scores))
        if best == len(scores) - 1:
            return Alarm(t_s, UNNAMED, None, "1", confidence)
        candidate = self._candidates[best % len(self._candidates)]
        size = float(gradient[best] / (information[best] + 1 / width[best]))
        return Alarm(t_s, candidate.name, size, candidate.unit, confidence)


TOLERATED = 0.25
"""Error of the twin that raises no alarm, as a share of the size of a change that matters."""

SIZES = {"torque_scale": 0.03, "plant.group_gain": 0.1, "sensors.angle_offset_rad": 1e-3}
"""Sizes of changes that are watched for, where they are not those of `identify`.

A window tells an offset and the torque of all groups well, and that of a single group hardly: there, what
the plant neglects looks like a change by 0.03.
"""

# Windows are awaited after a sum has exceeded the threshold, some in any case, as the first one seldom tells
# changes apart, and more until this posterior share.
_CERTAIN, _LEAST_WINDOWS, _MOST_WINDOWS = 0.99, 2, 3

# Standard deviation of changes, in units of those that matter.
_PLAUSIBLE = 5.0


class _Candidate(NamedTuple):
    """Change that is watched for."""

    name: str
    direction: Array
    """(p,) of the parameters."""
    size: float
    unit: str


def _candidates(parameters: Sequence[Parameter]) -> Iterator[_Candidate]:
    """Yield each parameter, and all hinges together for friction, which a bearing grease changes at once."""
    each = np.eye(len(parameters))
    for parameter, direction in zip(parameters, each, strict=True):
        yield _Candidate(parameter.name, direction, _size(parameter.kind), parameter.kind.unit)
    for kind in dict.fromkeys(parameter.kind for parameter in parameters):
        together = np.array([float(parameter.kind is kind) for parameter in parameters])
        if kind.name in _TOGETHER and together.sum() > 1:
            yield _Candidate(f"{kind.name} of all hinges", together, _size(kind), kind.unit)


def _size(kind: Kind) -> float:
    return SIZES.get(kind.name, kind.size)


_TOGETHER = ("plant.coulomb_Nm", "plant.viscous_Nm_s")


_ROWS_BEFORE = 30  # for the delay of the currents

_AFTER_GAP = 3  # windows until the shadow has found the state again
