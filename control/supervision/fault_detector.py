"""Fault detector: finds open and shorted groups, whose current no longer follows the command.

At each tick the measured current of a group is compared with three model currents:

- *driven*: the command through the nominal delay and lag (applied torque), limited to the current that the
  voltage swing of the amplifier drives through the coil;
- *open*: zero;
- *shorted*: the current of the back-EMF in the coil alone, ``L di/dt = -R i - e`` with ``e = G^T w``.

A tick indicates a fault if the measured current is within a threshold of the open or the shorted model, and
that model is further than twice the threshold from the driven one, so that both cannot hold. A tick at which
the current is near neither fault model indicates a healthy group and resets the count. Ticks with a small
command indicate nothing. After a given number of ticks that indicate a fault, without one that indicates
health, the group is disabled as open or as shorted, whichever model was closer (mean square of the
difference). At low rotor speed the two models differ by noise only, and the first classification is a guess.
Therefore both models are still compared with the current of a disabled group, which is not driven. The
classification changes if the sum of squares of the other model is smaller by the square of the threshold.
For any shorted current, noise causes this for a correct classification at six standard deviations.

*Threshold.* The measured current of a healthy group with a driven current of more than twice the threshold
must exceed the threshold. The threshold is therefore at least the largest static error of command and
measurement together, plus six standard deviations of the measurement noise, which a sample exceeds twice in
10⁹. The shorted model has errors too (warm copper, estimated rates): at least 1 % of the current limit.

*Ticks.* A healthy current is delayed if the voltage limits its rate: from one limit to the other it needs
``2 i L / (V - R i)``, with the swing V of the amplifier, and five time constants of the lag to settle. For
that time it may look like no current. The detector waits for that many ticks, and one more.
"""

from __future__ import annotations

from math import exp
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
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.coil_group import PerGroup
from spheretwin.models.kinematics import angular_velocity

DEVIATIONS = 6.0
LEAST_SHARE = 0.01  # of the current limit
SETTLING = 5.0  # time constants


class DetectorSection(BaseModel):
    """Detector of open and shorted groups; off unless switched on here or by a fault."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    detect: bool = Field(
        False, description="whether the controller detects groups whose current does not follow"
    )
    threshold_A: Annotated[float, Field(ge=1e-6, le=1e3)] | None = Field(
        None,
        description="threshold of the difference of currents, A; derived from `nominal` unless given",
    )
    ticks: Annotated[int, Field(ge=1, le=1000)] | None = Field(
        None,
        description="control ticks that must indicate a fault; derived from `nominal` unless given",
    )


class NominalCurrents(NamedTuple):
    """Nominal drive and nominal sensors of the currents."""

    period_s: float
    current_limit_A: float
    static_error_A: float
    """Largest difference between a command and its measured current at rest."""
    noise_A: float
    """Standard deviation of a measured current."""
    time_constant_s: PerGroup
    swing_V: float | Array
    """Of the amplifiers; infinite if unknown."""
    resistance_ohm: PerGroup
    inductance_H: PerGroup


class Detector(Record):
    """Detector of a run."""

    on: bool = field("whether the detector is on")
    threshold_A: float = field("threshold of the difference of currents", "A")
    ticks: int = field("ticks that must indicate a fault")
    decay: Array = field("of the current of a shorted coil, over a control period", "", "groups")
    resistance_ohm: Array = field("resistance of each group", "Ω", "groups")
    reach_A: Array = field("current that the swing drives through the coil", "A", "groups")
    measured_A: Array = field("measured currents", "A", "groups")
    shorted_A: Array = field("current of the shorted model", "A", "groups", state=True)
    indications: NDArray[np.int64] = field("ticks that indicate a fault", "", "groups", state=True)
    open_A2: Array = field("sum of squared differences over these ticks", "A²", "groups", state=True)
    shorted_A2: Array = field("the same of the shorted model", "A²", "groups", state=True)
    rate_S: Array = field("angular velocity, stator frame", "rad/s", 3)


def derived_threshold_A(nominal: NominalCurrents) -> Any:
    """Return the threshold that avoids false alarms; see the module's docstring."""
    errors = nominal.static_error_A + DEVIATIONS * nominal.noise_A
    return np.maximum(LEAST_SHARE * nominal.current_limit_A, errors)


def derived_ticks(nominal: NominalCurrents) -> NDArray[np.float64]:
    """Return the ticks for which a healthy current of the slowest group may look like none, plus one."""
    R, L, lag_s = map(np.atleast_1d, (nominal.resistance_ohm, nominal.inductance_H, nominal.time_constant_s))
    spare_V = nominal.swing_V - R * nominal.current_limit_A
    # If the swing cannot drive the limit at all, the current settles with L/R at best.
    swing_s = 2 * nominal.current_limit_A * L / np.where(spare_V > 0, spare_V, np.nan)
    slow_s = np.fmin(swing_s, SETTLING * L / R) + SETTLING * lag_s
    return 1 + np.ceil(np.max(slow_s, axis=-1, keepdims=True) / nominal.period_s)


def fill_detector(rows: Rows, section: DetectorSection, on: bool, nominal: NominalCurrents) -> None:
    """Fill detectors before the first measurement, for the nominal currents of healthy groups."""
    resistance_ohm = np.asarray(nominal.resistance_ohm)
    periods = np.asarray(nominal.period_s * resistance_ohm / nominal.inductance_H)
    threshold_A, ticks = section.threshold_A, section.ticks
    put(rows, on=on, resistance_ohm=resistance_ohm, reach_A=nominal.swing_V / resistance_ohm)
    put(rows, decay=np.reshape([exp(-rate) for rate in periods.ravel()], periods.shape))
    put(rows, threshold_A=derived_threshold_A(nominal) if threshold_A is None else threshold_A)
    put(rows, ticks=derived_ticks(nominal) if ticks is None else ticks)


@allocation_free
def detect_faults(
    detector: Detector, groups: EnabledGroups, applied: Array, G: Array, q: Array, qdot: Array, t: float
) -> None:
    """Compare the measured currents of one control tick with the model currents.

    Parameters
    ----------
    detector : Detector
        Changed in place.
    groups : EnabledGroups
        Groups found faulty are disabled.
    applied : (n,) array, A
        Estimated driven currents at this tick.
    G : (3, n) array, N·m/A
        Nominal torque matrix of all groups.
    q, qdot : (3,) arrays, rad and rad/s
        Pose and rates of the controller.
    t : float, s
    """
    threshold = detector.threshold_A
    angular_velocity(q, qdot, detector.rate_S)
    for j in range(applied.shape[0]):
        emf = G[0, j] * detector.rate_S[0] + G[1, j] * detector.rate_S[1] + G[2, j] * detector.rate_S[2]
        settled = -emf / detector.resistance_ohm[j]
        shorted = settled + (detector.shorted_A[j] - settled) * detector.decay[j]
        detector.shorted_A[j] = shorted
        measured, state = detector.measured_A[j], groups.out[j]
        driven = min(max(applied[j], -detector.reach_A[j]), detector.reach_A[j])
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
        detector.indications[j] += 1
        _accumulate(detector, j, open_error, shorted_error)
        if detector.indications[j] >= detector.ticks:
            is_open = detector.open_A2[j] <= detector.shorted_A2[j]
            groups.out[j] = DETECTED_OPEN if is_open else DETECTED_SHORTED
            groups.out_s[j] = t


@allocation_free
def _reset(detector: Detector, group: int) -> None:
    """Reset the count and the sums of a group."""
    detector.indications[group] = 0
    detector.open_A2[group] = detector.shorted_A2[group] = 0.0


@allocation_free
def _accumulate(detector: Detector, group: int, open_error: float, shorted_error: float) -> None:
    """Add the squared differences (A) of one tick to the sums of both models."""
    detector.open_A2[group] += open_error * open_error
    detector.shorted_A2[group] += shorted_error * shorted_error


@allocation_free
def _classify(detector: Detector, group: int, state: int) -> int:
    """Return the state of a detected group: unchanged, unless the other model has become clearly closer."""
    difference = detector.open_A2[group] - detector.shorted_A2[group]
    if abs(difference) <= detector.threshold_A * detector.threshold_A:
        return state
    return DETECTED_SHORTED if difference > 0.0 else DETECTED_OPEN
