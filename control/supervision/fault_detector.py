"""Finds groups whose current no longer follows: open ones and shorted ones.

Each tick the measured current of a group is held against three accounts of it:

- *driven*: what the controller believes, its command through the nominal delay and lag, as far as the swing
  of the amplifier carries it through the coil;
- *open*: nothing;
- *shorted*: what the back-EMF drives through the coil alone, ``L di/dt = -R i - e`` with ``e = G^T w``.

A tick speaks for a fault where the measured current is within a threshold of an undriven account, and that
account is further than twice the threshold from the driven one: it could not be both. A tick at which the
current is near neither undriven account speaks for health, and what was counted before is forgotten. Ticks at
which little is commanded say nothing. So many ticks that speak for a fault, with none between that speaks
against, and the group is taken to be out, as open or as shorted, whichever account was closer (the mean
square of the difference). Where the rotor is slow the two accounts are one but for noise, and the first name
is a guess. So both go on being held against the current of a group that is out, which nothing drives any
more, and the name changes where the sum of squares of the other one has become less by the square of the
threshold. Whatever the account of a shorted coil, noise does that to a true name at six standard deviations.

*Threshold.* A healthy group that is believed to carry more than twice the threshold must not be measured
below it: the threshold is at least the largest static error of command and measurement together, and six
standard deviations of the measurement's noise, which a sample passes twice in 10⁹. The account of a shorted
coil has errors too (warm copper, estimated rates): no less than 1 % of the current limit.

*Ticks.* A healthy current is late where the voltage limits its rate: from one limit to the other it needs
``2 i L / (V - R i)``, of the swing V that is left to the amplifier, and five time constants of the lag to
settle. It may look like none for so long. The detector waits for that many ticks, and one more.
"""

from __future__ import annotations

from math import ceil, exp
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.control.supervision.enabled_groups import (
    DETECTED_OPEN,
    DETECTED_SHORTED,
    IN_USE,
    REPORTED,
    EnabledGroups,
)
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.kinematics import angular_velocity

DEVIATIONS = 6.0
LEAST_SHARE = 0.01  # of the current limit
SETTLING = 5.0  # time constants

Array = NDArray[np.float64]


class DetectorSection(BaseModel):
    """Detector of open and shorted groups; off unless asked for here or by a fault."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    detect: bool = Field(False, description="whether the controller looks for groups that do not follow")
    threshold_A: Annotated[float, Field(ge=1e-6, le=1e3)] | None = Field(
        None,
        description="current below which a group may carry none, A; derived from `nominal` unless given",
    )
    ticks: Annotated[int, Field(ge=1, le=1000)] | None = Field(
        None,
        description="control ticks in a row that must speak for a fault; derived from `nominal` unless given",
    )


class NominalCurrents(NamedTuple):
    """Nominal drive and nominal sensors of the currents."""

    period_s: float
    current_limit_A: float
    static_error_A: float
    """Largest difference between a command and its measured current at rest."""
    noise_A: float
    """Standard deviation of a measured current."""
    time_constant_s: float
    swing_V: float
    """Of the amplifiers; infinite where none is known."""
    resistance_ohm: float
    inductance_H: float


class Detector(NamedTuple):
    """Detector of a run, for compiled code."""

    on: bool
    threshold_A: float
    ticks: int
    decay: float  # of the current of a shorted coil, over a control period
    resistance_ohm: float
    reach_A: float  # that the swing carries through the coil
    measured_A: Array  # (n,) what the sensors of the currents say
    shorted_A: Array  # (n,) what a shorted coil would carry
    count: NDArray[np.int64]  # (n,) ticks that speak for a fault
    open_A2: Array  # (n,) squared differences over these ticks
    shorted_A2: Array  # (n,)
    rate_S: Array  # (3,) rad/s

    def state_arrays(self) -> tuple[NDArray[Any], ...]:
        """Arrays that it goes on from."""
        return self.shorted_A, self.count, self.open_A2, self.shorted_A2


def derived_threshold_A(nominal: NominalCurrents) -> float:
    """Threshold that keeps healthy groups healthy, as the head of this file says."""
    errors = nominal.static_error_A + DEVIATIONS * nominal.noise_A
    return max(LEAST_SHARE * nominal.current_limit_A, errors)


def derived_ticks(nominal: NominalCurrents) -> int:
    """Ticks for which a healthy current may look like none, and one more."""
    spare_V = nominal.swing_V - nominal.resistance_ohm * nominal.current_limit_A
    # Where the swing does not carry the limit at all, the current gets there with L/R at best.
    natural_s = SETTLING * nominal.inductance_H / nominal.resistance_ohm
    swing_s = 2 * nominal.current_limit_A * nominal.inductance_H / spare_V if spare_V > 0 else natural_s
    slow_s = min(swing_s, natural_s) + SETTLING * nominal.time_constant_s
    return 1 + ceil(slow_s / nominal.period_s)


def detector(section: DetectorSection, on: bool, groups: int, nominal: NominalCurrents) -> Detector:
    """Detector that has seen nothing yet.

    Parameters
    ----------
    section : DetectorSection
    on : bool
        Whether it looks.
    groups : int
    followed : Followed
        What healthy groups do.
    """
    return Detector(
        on=on,
        threshold_A=section.threshold_A or derived_threshold_A(nominal),
        ticks=section.ticks or derived_ticks(nominal),
        decay=exp(-nominal.period_s * nominal.resistance_ohm / nominal.inductance_H),
        resistance_ohm=nominal.resistance_ohm,
        reach_A=nominal.swing_V / nominal.resistance_ohm,
        measured_A=np.zeros(groups),
        shorted_A=np.zeros(groups),
        count=np.zeros(groups, dtype=np.int64),
        open_A2=np.zeros(groups),
        shorted_A2=np.zeros(groups),
        rate_S=np.zeros(3),
    )


@allocation_free
def detect_faults(
    detector: Detector, groups: EnabledGroups, applied: Array, G: Array, q: Array, qdot: Array, t: float
) -> None:
    """Hold the measured currents of one control tick against what they would be.

    Parameters
    ----------
    detector : Detector
        Changed in place.
    groups : Groups
        What is found is left out from now on.
    believed : (n,) array, A
        Currents at this tick as the controller believes them.
    G : (3, n) array, N·m/A
        Nominal torque matrix, whole.
    q, qdot : (3,) arrays, rad and rad/s
        As the controller has them.
    t : float, s
    """
    threshold = detector.threshold_A
    angular_velocity(q, qdot, detector.rate_S)
    for j in range(applied.shape[0]):
        emf = G[0, j] * detector.rate_S[0] + G[1, j] * detector.rate_S[1] + G[2, j] * detector.rate_S[2]
        settled = -emf / detector.resistance_ohm
        shorted = settled + (detector.shorted_A[j] - settled) * detector.decay
        detector.shorted_A[j] = shorted
        measured, state = detector.measured_A[j], groups.out[j]
        driven = min(max(applied[j], -detector.reach_A), detector.reach_A)
        open_error, shorted_error = abs(measured), abs(measured - shorted)
        if state == REPORTED:
            _reset(detector, j)
            continue
        if state != IN_USE:
            _accumulate(detector, j, open_error, shorted_error)
            groups.out[j] = _classify(detector, j, state)
            continue
        if not min(open_error, shorted_error) <= threshold:
            _reset(detector, j)
            continue
        indicates_fault = (open_error <= threshold and abs(driven) > 2.0 * threshold) or (
            shorted_error <= threshold and abs(driven - shorted) > 2.0 * threshold
        )
        if not indicates_fault:
            continue
        detector.count[j] += 1
        _accumulate(detector, j, open_error, shorted_error)
        if detector.count[j] >= detector.ticks:
            is_open = detector.open_A2[j] <= detector.shorted_A2[j]
            groups.out[j] = DETECTED_OPEN if is_open else DETECTED_SHORTED
            groups.out_s[j] = t
            groups.some_out[0] = True


@allocation_free
def _reset(detector: Detector, group: int) -> None:
    """Begin anew with a group."""
    detector.count[group] = 0
    detector.open_A2[group] = detector.shorted_A2[group] = 0.0


@allocation_free
def _accumulate(detector: Detector, group: int, open_error: float, shorted_error: float) -> None:
    """Add the differences (A) of one tick to what speaks against either account."""
    detector.open_A2[group] += open_error * open_error
    detector.shorted_A2[group] += shorted_error * shorted_error


@allocation_free
def _classify(detector: Detector, group: int, state: int) -> int:
    """How a group that was found stands: as before, unless the other account has become closer by far."""
    difference = detector.open_A2[group] - detector.shorted_A2[group]
    if abs(difference) <= detector.threshold_A * detector.threshold_A:
        return state
    return DETECTED_SHORTED if difference > 0.0 else DETECTED_OPEN
