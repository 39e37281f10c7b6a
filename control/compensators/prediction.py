r"""Delay compensation: predicts the rotor's motion at the time at which the command of this tick acts.

The currents respond to a measurement after the nominal delay. The nominal equations of motion advance the
measured angles and rates over that delay, under the torque of the pending commands in `AppliedTorque`. Load
and friction are left out: over 1 ms the prototype's friction changes a rate by 1 mrad/s.

*Inputs of the law.* Rows 0 to 2 of the measurement (angle, rate, torque over the last period) are those of
the time at which the command begins to act. The rows of the reference are advanced to the same time by their
own rate and acceleration. `NominalModel.delay_s` is 0. For a law that is not aware of the prediction, also
one with its own observer, there is no delay, and angle and torque belong to the same time. A law that
corrects its observer with the measured values and predicts the motion itself finds these values in rows 3 to
5, in the same order, with the torque that belongs to them. `NominalModel.ahead_s` is the time from rows 3 to
5 to rows 0 to 2.

*Allocation.* The currents are computed for the pose at which they begin to act.

*Steps.* One step for each pending command: its mean current, solved exactly through the lag, acts on the
rotor over the midpoint rule. The shape of the current within a period is left out. Both errors are of second
order in the period.

*Benefit.* A known delay no longer destabilises the loop. The start and the corners of a reference are still
followed late, and noise of the rates is extrapolated over the delay. The study `delays` measures it on the
prototype's tilt.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.control.applied_torque import AppliedTorque, LagStep, fill_lag_step
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.coil_group import PerGroup
from spheretwin.models.kinematics import generalised_torque, triple, turns
from spheretwin.models.lagrangian import acceleration_entries
from spheretwin.models.magnetics import (
    Arrangement,
    CachedMatrix,
    Tables,
    rotor_torque,
    update_cached_matrix,
)

MEASURED = 3
"""First row of the measured values."""


class PredictionSection(BaseModel):
    """Prediction over the nominal delay; off by default."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    on: bool = Field(False, description="whether the law receives the predicted motion after nominal.delay_s")


class Prediction(Record):
    """Prediction of a run."""

    on: bool = field("whether the prediction is on")
    ahead_s: float = field("time from the measurement to the predicted motion", "s")
    period_s: float = field("control period", "s")
    inertia: Array = field("nominal", "kg·m²", 3)
    full_lag: LagStep = field("lag over a period")
    pose: Array = field("predicted", "rad", 3, state=True)
    rates: Array = field("predicted", "rad/s", 3, state=True)
    matrix: CachedMatrix = field("nominal torque matrix at the predicted pose")
    midpoint: Array = field("pose in the middle of a step", "rad", 3)
    current: Array = field("currents at the end of a step", "A", "groups")
    mean_current: Array = field("currents over a step", "A", "groups")
    torque_S: Array = field("torque over a step, stator frame", "N·m", 3)
    torque_q: Array = field("the same on the hinges", "N·m", 3)
    first_step_torque_q: Array = field("torque over the first step of the last tick", "N·m", 3, state=True)


class DelayModel(NamedTuple):
    """Nominal delay, lag and inertia."""

    period_s: float
    delay_s: float
    time_constant_s: PerGroup
    inertia: Array  # (3,) kg·m²


def fill_prediction(rows: Rows, section: PredictionSection, model: DelayModel) -> None:
    """Fill predictions without pending commands."""
    put(rows, on=section.on, ahead_s=model.delay_s, period_s=model.period_s, inertia=model.inertia)
    rows["matrix"]["q"] = np.nan
    fill_lag_step(rows["full_lag"], model.period_s, model.time_constant_s)


@allocation_free
def predict(
    prediction: Prediction,
    applied_torque: AppliedTorque,
    arrangement: Arrangement,
    tables: Tables,
    measurement: Array,
) -> bool:
    """Write the predicted values into rows 0 to 2 of a measurement and the measured values into rows 3 to 5.

    Parameters
    ----------
    prediction : Prediction
        Changed in place.
    applied_torque : AppliedTorque
        Estimate at the time of the measurement.
    arrangement : Arrangement
    tables : Tables
        Of the nominal magnetics.
    measurement : (6, 3) array
        Angle, rate and torque of the last period as rows; changed in place.

    Returns
    -------
    bool
        True if the prediction is finite; otherwise its state is set to 0.
    """
    pose, rates = prediction.pose, prediction.rates
    for i in range(3):
        pose[i], rates[i] = measurement[0, i], measurement[1, i]
        for row in range(MEASURED):
            measurement[MEASURED + row, i] = measurement[row, i]
    for j in range(prediction.current.shape[0]):
        prediction.current[j] = applied_torque.current[j]
    whole, fraction, finite = applied_torque.due, applied_torque.fraction, True
    if fraction > 0.0:
        command = applied_torque.commands[whole]
        duration_s, lag = fraction * prediction.period_s, applied_torque.older_lag
        finite = _step(prediction, arrangement, tables, command, duration_s, lag)
        for i in range(3):
            if whole == 0:  # the period that ends there began within the last one
                measurement[2, i] += fraction * (prediction.torque_q[i] - prediction.first_step_torque_q[i])
            prediction.first_step_torque_q[i] = prediction.torque_q[i]
    for row in range(whole - 1, -1, -1):
        command, lag = applied_torque.commands[row], prediction.full_lag
        finite = finite and _step(prediction, arrangement, tables, command, prediction.period_s, lag)
    finite = finite and _update_matrix(prediction, arrangement, tables, pose)
    for i in range(3):
        if whole > 0:
            measurement[2, i] = prediction.torque_q[i]
        finite = finite and isfinite(rates[i])
    for i in range(3):
        if not finite:
            pose[i] = rates[i] = prediction.first_step_torque_q[i] = 0.0
        measurement[0, i], measurement[1, i] = pose[i], rates[i]
    return finite


@allocation_free
def advance(prediction: Prediction, reference: Array) -> None:
    """Advance the rows of a reference by the same time."""
    ahead = prediction.ahead_s
    for i in range(3):
        reference[0, i] += ahead * (reference[1, i] + 0.5 * ahead * reference[2, i])
        reference[1, i] += ahead * reference[2, i]


@allocation_free
def _step(
    prediction: Prediction,
    arrangement: Arrangement,
    tables: Tables,
    command: Array,
    duration_s: float,
    lag: LagStep,
) -> bool:
    """Advance pose, rates and currents while one command acts; return True if the pose stays finite."""
    q, v, midpoint = prediction.pose, prediction.rates, prediction.midpoint
    for i in range(3):
        midpoint[i] = q[i] + 0.5 * duration_s * v[i]
    if not _update_matrix(prediction, arrangement, tables, midpoint):
        return False
    for j in range(command.shape[0]):
        distance = prediction.current[j] - command[j]
        prediction.mean_current[j] = command[j] + lag.mean_share[j] * distance
        prediction.current[j] = command[j] + lag.decay[j] * distance
    rotor_torque(prediction.matrix.G, prediction.mean_current, prediction.torque_S)
    generalised_torque(midpoint, prediction.torque_S, prediction.torque_q)
    torque, inertia = triple(prediction.torque_q), triple(prediction.inertia)
    first = acceleration_entries(turns(triple(q)), triple(v), torque, inertia, 0.0)
    half = 0.5 * duration_s
    between = v[0] + half * first[0], v[1] + half * first[1], v[2] + half * first[2]
    second = acceleration_entries(turns(triple(midpoint)), between, torque, inertia, 0.0)
    for i in range(3):
        q[i] += duration_s * between[i]
        v[i] += duration_s * second[i]
    return True


@allocation_free
def _update_matrix(prediction: Prediction, arrangement: Arrangement, tables: Tables, pose: Array) -> bool:
    """Update the torque matrix at a pose; return False if the pose is not finite."""
    for i in range(3):
        if not isfinite(pose[i]):
            return False
    update_cached_matrix(pose, arrangement, tables, prediction.matrix)
    return True
