r"""Watch over a machine: alarms when its parameters change, with a stated rate of false alarms.

The evidence of a change is the mean of its likelihood ratio over all changes that are watched for, their
sizes, and the times within the last second at which they may have begun. If nothing has changed, the mean of
the evidence is 1, so it exceeds a threshold η at most with probability 1/η (Markov). That gives the threshold
for a rate of alarms. What has changed is decided once the shares of the explanations are clear.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import log as logarithm
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field
from scipy.special import logsumexp

from spheretwin.machine.change_diagnosis import ChangeDiagnosis, Explanation, evidence_of_noise, shares_of
from spheretwin.machine.change_filter import BlockRows, ChangeFilter, FilterStep, Linearisation
from spheretwin.machine.explanations import (
    LOADS,
    NONLINEAR,
    TOLERATED,
    UNLIKELY,
    UNNAMED,
    candidates_of,
    evidence,
    size_of,
)
from spheretwin.machine.log import Log, joined
from spheretwin.machine.parameters import Machine, selected
from spheretwin.machine.signatures import Signatures
from spheretwin.machine.state_estimation import Shadow
from spheretwin.machine.windows import Window
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.fields import SettingsModel

WATCHED = (
    "torque_scale",
    "plant.group_gain",
    "plant.coulomb_Nm",
    "plant.viscous_Nm_s",
    "plant.modelling_torque_Nm",
    "plant.payload_kg",
    "sensors.angle_offset_rad",
)
"""Parameters that are watched unless others are named."""

HORIZON_s = 1.0
"""Time before the present within which a change may have begun."""

_NOISES_Nm_s = (1e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3)
"""Roots of densities of the torque without a cause, among which the first seconds decide."""


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
    """Probability that this name is right; of ``unexplained``, that the most probable name would be wrong."""
    onset_s: float
    """Most probable time of the change."""
    lasted_s: float | None
    """Duration of a change that is over; None if it lasts."""
    shares: dict[str, float]
    """Probabilities of the names, the most probable first; those below 1 % are left out."""

    def text(self) -> str:
        """Return the alarm as a line."""
        size = "" if self.size is None else f" {self.size:+.3g}{'' if self.unit == '1' else f' {self.unit}'}"
        lasted = "" if self.lasted_s is None else f" for {self.lasted_s:.2g} s"
        return f"{self.what}{size}{lasted}, confidence {self.confidence:.1%}"


class JudgedWindow(NamedTuple):
    """A window that a watch has judged."""

    t_s: float
    """Its end."""
    chi2: float
    """Mean square of its residuals over that of the noise."""
    evidence: float
    """Logarithm of the evidence of a change over the threshold: an alarm is due from 1."""


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
        Of the logarithm of the evidence.
    variance : float
        Variance of the residuals over that of the sensors' noise, measured at the start; at least 1.
    misfit : float
        The same if no torque is without a cause: what the twin does not explain of the start.
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
        actuator = self._machine.model.actuator
        self._watched = selected(parameters, actuator)
        if not self._watched:
            raise InputError("watch: expected at least one parameter, received none")
        self._parameters = selected([*WATCHED, *UNLIKELY, *parameters], actuator)
        self._values = np.array([self._machine.nominal(parameter) for parameter in self._parameters])
        self._tolerated = TOLERATED * np.array([size_of(one.kind) for one in self._parameters])
        self._loads = [place for place, one in enumerate(self._parameters) if one.kind.name == LOADS]
        windows_per_hour = 3600 / self.settings.window_s
        self.threshold = logarithm(windows_per_hour / self.settings.false_alarms_per_hour)
        self.judged: list[JudgedWindow] = []
        self.variance = self.misfit = 1.0
        self._rows: Log | None = None
        self._place = 0  # row of the estimate
        self._period_s = 0.0
        self._measure_noise(-np.inf)

    @property
    def sums(self) -> dict[str, float]:
        """Logarithm of the evidence of each change after the last window; at least 0."""
        return dict(self._evidence)

    def _measure_noise(self, t_s: float) -> None:
        """Measure the noise again from a time on."""
        self.variance, self._calibrated_s = 1.0, t_s + self.settings.calibration_s
        self._filters = [ChangeFilter(self._tolerated, self._loads, noise) for noise in _NOISES_Nm_s]
        self._fits = np.zeros((len(self._filters), 3))  # squares, half logarithms of determinants, angles
        self._restart()

    def _go_on(self) -> None:
        """Start anew from the present values."""
        self._candidates = candidates_of(self._parameters, self._values, self._watched)
        self._linearisation = Linearisation(self._machine, self._parameters, self._values, self.variance)
        self._steps: deque[FilterStep] = deque()
        self._signatures = Signatures(self._candidates)
        self._evidence = {one.name: 0.0 for one in self._candidates} | {UNNAMED: 0.0}
        self._waited: int | None = None  # windows since the evidence has exceeded the threshold
        self._due = 1  # blocks until changes of the plant begin
        self._total = 0.0

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
            Shadow(self._machine.model).advance(rows.rows(0, 2))
            self._period_s = float(np.median(np.diff(rows.t_s[:_ROWS_BEFORE])))
            self._calibrated_s = float(rows.t_s[0]) + self.settings.calibration_s
        period_s, alarms = self._period_s, []
        count = max(round(self.settings.window_s / period_s), 10)
        while self._place + count < len(rows):
            end = self._place + count
            times = np.diff(rows.t_s[self._place : end + 1])
            if not np.all(np.abs(times - period_s) < 0.2 * period_s):  # a gap, with unknown currents
                self._restart()
            elif self._waits:
                self._find_state(rows, end)
            else:
                alarms += self._judge(Window(rows, self._machine, self._place, count, _UNUSED, _UNUSED))
            self._place = end
        spare = max(self._place - _ROWS_BEFORE, 0)
        self._rows, self._place = rows.rows(spare, len(rows)), self._place - spare
        return alarms

    def _restart(self) -> None:
        """Look for the state again."""
        self._shadow: Shadow | None = None
        self._waits = _START_WINDOWS  # until its state is used
        self._go_on()

    def _find_state(self, rows: Log, end: int) -> None:
        """Advance the shadow over a window; go on from it after the last one."""
        if self._shadow is None:
            self._shadow = Shadow(self._machine.model)
        self._shadow.advance(rows.rows(self._place + 1, end + 1))
        self._waits -= 1
        if self._waits:
            return
        mean, covariance = self._shadow.motion()
        self._shadow = None
        is_offset = [one.kind.name == "sensors.angle_offset_rad" for one in self._parameters]
        mean[:3] -= self._values[is_offset] - self._machine.model.offset_rad
        # Within a count the shadow's distribution is not normal: its errors last.
        covariance[range(3), range(3)] += self._machine.model.half_count_rad**2 / 3
        for one in self._filters:
            one.start(mean, covariance)

    def _judge(self, window: Window) -> list[Alarm]:
        """Judge a window; return new alarms."""
        squares = used = 0.0
        for rows in BlockRows(window, *window.measured()).blocks():
            block = self._linearisation.block(rows, self._filters[0].estimate.state)
            for place, plain in enumerate(self._filters):
                step = plain.advance(block)
                self._fits[place] += step.squares, step.cost - 0.5 * step.squares, len(step.whitened)
            squares, used = squares + step.squares, used + len(step.whitened)
            if len(self._filters) == 1:
                self._add(step)
        t_s = float(window.log.t_s[window.first + window.rows])
        if len(self._filters) > 1:
            if t_s >= self._calibrated_s:
                self._calibrate()
            return []
        alarms = self._decide(t_s)
        self.judged.append(JudgedWindow(t_s, squares / max(used, 1), self._total / self.threshold))
        return alarms

    def _calibrate(self) -> None:
        """Choose the noise of the torque, and the variance of the residuals, that explain the rows so far."""
        squares, determinants, used = self._fits.T
        variances = np.maximum(squares / np.maximum(used, 1), 1.0)
        best = int(np.argmin(used * np.log(variances) + 2 * determinants + squares / variances))
        self._filters, self.misfit = [self._filters[best]], float(variances[0])
        self._filters[0].torque_noise_Nm_s *= float(np.sqrt(variances[best]))
        self.variance = self._linearisation.variance = float(variances[best])

    def _add(self, step: FilterStep) -> None:
        """Let signatures pass a step, and new ones begin in it."""
        self._steps.append(step)
        if self._waited is None and len(self._steps) * step.block.length_s > HORIZON_s + 1e-9:
            self._steps.popleft()
        self._due = (self._due - 1) % _COARSE
        sensors = [number for number, one in enumerate(self._candidates) if one.is_sensor]
        begin = np.array(sensors if self._due else range(len(self._candidates)))
        self._signatures.advance(step, begin, np.zeros_like(begin))

    def _decide(self, t_s: float) -> list[Alarm]:
        """Return the alarm of a window that ends at a time, if there is one."""
        if self._waited is None:
            self._signatures.forget(t_s - HORIZON_s)
            self._total = self._weigh()
            if self._total < self.threshold:
                return []
            self._waited = 0
        self._waited += 1
        if self._waited < _LEAST_WINDOWS:
            return []
        explanations = [
            explanation for explanation in self._explanations() if explanation.remaining <= MOST_REMAINING
        ]
        return [self._raise(t_s, explanations)] if self._is_due(explanations) else []

    def _is_due(self, explanations: Sequence[Explanation]) -> bool:
        """True if the next window is not awaited: it would hardly tell better what has changed."""
        assert self._waited
        names, shares = shares_of(explanations)
        name, share = next(iter(names.items()))
        is_certain = share >= _CERTAIN and shares.max() >= _CLEAR
        least = _WINDOWS_OF_PUSH if name == UNNAMED else _LEAST_WINDOWS
        return (is_certain and self._waited >= least) or self._waited >= _MOST_WINDOWS

    def _explanations(self) -> list[Explanation]:
        """Return all explanations, of which the most probable changes of the plant are replayed."""
        diagnosis = ChangeDiagnosis(self._candidates, list(self._steps))
        order = sorted(diagnosis.explanations(), key=lambda explanation: -explanation.log_evidence)
        named = [place for place, explanation in enumerate(order) if explanation.name != UNNAMED]
        least = (1 - NONLINEAR) * order[named[0]].log_evidence
        for place in named[:_MOST_REPLAYS]:
            candidate = order[place].candidate
            if candidate and not candidate.is_sensor and order[place].log_evidence > least:
                order[place] = diagnosis.replayed(order[place], self._filters[0], self._linearisation)
        return order

    def _weigh(self) -> float:
        """Return the logarithm of the evidence of any change, and note that of each."""
        number = self._signatures.candidate
        each = evidence(self._signatures.gradient, self._signatures.information, self._candidates, number)
        logs = []
        for place, one in enumerate(self._candidates):
            mine = each[number == place]
            value = float(logsumexp(mine)) - logarithm(max(len(mine), 1)) if len(mine) else 0.0
            self._evidence[one.name] = max(value, 0.0)
            logs.append(value + one.log_prior)
        squares = np.array([step.squares for step in self._steps])
        noise = evidence_of_noise(squares, np.array([len(step.whitened) for step in self._steps]))
        value = float(logsumexp(noise)) - logarithm(noise.size)
        self._evidence[UNNAMED] = max(value, 0.0)
        return float(logsumexp([logsumexp(logs), value])) - logarithm(2)

    def _raise(self, t_s: float, explanations: Sequence[Explanation]) -> Alarm:
        """Return the alarm, and go on from the changed machine."""
        names, _ = shares_of(explanations)
        listed = {name: share for name, share in names.items() if share >= LEAST_LISTED}
        name, confidence = next(iter(names.items()))
        best = max(
            (explanation for explanation in explanations if explanation.name == name),
            key=lambda explanation: explanation.log_evidence,
        )
        if name == UNNAMED or best.candidate is None or confidence < LEAST_SHARE:
            others = (share for other, share in names.items() if other != UNNAMED)
            self._measure_noise(t_s)
            return Alarm(t_s, UNNAMED, None, "1", 1 - max(others, default=0.0), best.onset_s, None, listed)
        self._filters[0].estimate = best.estimate_after(self._filters[0].estimate)
        self._values = self._values + best.direction * best.size
        self._go_on()
        unit = best.candidate.kind.unit
        return Alarm(t_s, name, best.size, unit, confidence, best.onset_s, best.lasted_s, listed)


_ROWS_BEFORE = 30  # for the delay of the currents

_START_WINDOWS = 2  # until the shadow has found the state

_COARSE = 5  # blocks between onsets that are tested in each window

# Windows after the evidence has exceeded the threshold, and shares of a name and of a single explanation that
# end the wait. A push has no name until it is over.
_LEAST_WINDOWS, _WINDOWS_OF_PUSH, _MOST_WINDOWS, _CERTAIN, _CLEAR = 2, 4, 5, 0.9, 0.9

_MOST_REPLAYS = 2

LEAST_SHARE, LEAST_LISTED = 0.5, 0.01
"""Probability that a name needs, and that of names in an alarm."""

MOST_REMAINING = 5.0
"""Standard deviations by which the squares that an explanation leaves may exceed their expected value."""

_UNUSED = np.zeros(0)
