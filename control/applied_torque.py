"""Applied torque: estimate of the torque over the last control period, from commands, nominal delay and lag.

The nominal delay is n + f periods. Over the period that begins with command k, the amplifiers follow command
k - n - 1 for a share f of the period, then command k - n. The lag is solved exactly over both parts.
"""

from __future__ import annotations

from math import exp, expm1
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.history import push_all
from spheretwin.models.base.record import Record, Rows, capacity, field, put
from spheretwin.models.coil_group import PerGroup
from spheretwin.models.kinematics import generalised_torque
from spheretwin.models.magnetics import rotor_torque

# A delay of a whole number of periods is one to rounding only.
ROUNDING = 1e-9


class LagStep(Record):
    """First-order lag over a part of a period, with a constant command."""

    decay: Array = field(
        "remaining share of the distance to the command at the end of the part", "", "groups"
    )
    mean_share: Array = field("mean remaining share of that distance", "", "groups")


class AppliedTorque(Record):
    """Estimated currents and applied torque."""

    on: bool = field("whether the law, the detector or the prediction uses it")
    due: int = field("row of the commands that acts at the end of a period: whole periods of the delay")
    fraction: float = field("share of a period in which the older command acts, f")
    older_lag: LagStep = field("lag over that share")
    newer_lag: LagStep = field("lag over the rest of the period")
    commands: Array = field("commands, newest first", "A", ("delays", "groups"), state=True)
    current: Array = field("currents at the end of the last period", "A", "groups", state=True)
    mean_current: Array = field("currents over the last period", "A", "groups")
    torque_S: Array = field("mean torque over the last period, stator frame", "N·m", 3)
    torque_q: Array = field("the same on the hinges; NaN if it is off", "N·m", 3, state=True)


def fill_applied_torque(
    rows: Rows, on: bool, period_s: float, delay_s: float, time_constant_s: PerGroup
) -> None:
    """Fill applied torques at rest: no currents and no pending commands.

    Parameters
    ----------
    rows : rows of `AppliedTorque`
        As many delays as `delay_capacity` gives.
    on : bool
        Whether it is used.
    period_s, delay_s : float, s
        Control period and nominal delay.
    time_constant_s : float or one for each group, s
        Time constant L/R of the lag; 0 for none.
    """
    due, fraction = split_delay(np.where(on, delay_s, 0.0), period_s)
    put(rows, on=on, due=due, fraction=fraction, torque_q=np.where(on, 0.0, np.nan))
    fill_lag_step(rows["older_lag"], fraction * period_s, time_constant_s)
    fill_lag_step(rows["newer_lag"], (1 - fraction) * period_s, time_constant_s)


@allocation_free
def estimate_applied_torque(
    applied_torque: AppliedTorque,
    pose: Array,
    G: Array,
    command: Array,
) -> None:
    """Advance the estimate by one control period.

    Parameters
    ----------
    applied_torque : AppliedTorque
        Changed in place.
    pose : (3,) array, rad
        Measured at the beginning of the period.
    G : (3, groups) array, N·m/A
        Nominal torque matrix at that pose.
    command : (groups,) array, A
        Commanded in this tick.
    """
    current, mean_current, fraction, due = (
        applied_torque.current,
        applied_torque.mean_current,
        applied_torque.fraction,
        applied_torque.due,
    )
    push_all(applied_torque.commands, command)
    for j in range(command.shape[0]):
        older, newer = applied_torque.commands[due + 1, j], applied_torque.commands[due, j]
        distance = current[j] - older
        first = older + applied_torque.older_lag.mean_share[j] * distance
        distance = older + applied_torque.older_lag.decay[j] * distance - newer
        mean_current[j] = fraction * first + (1.0 - fraction) * (
            newer + applied_torque.newer_lag.mean_share[j] * distance
        )
        current[j] = newer + applied_torque.newer_lag.decay[j] * distance
    rotor_torque(G, mean_current, applied_torque.torque_S)
    generalised_torque(pose, applied_torque.torque_S, applied_torque.torque_q)


def split_delay(delay_s: ArrayLike, period_s: ArrayLike) -> tuple[Any, Any]:
    """Return the whole periods of delays and the remaining shares of a period."""
    periods = np.divide(delay_s, period_s)
    whole = np.floor(periods * (1 + ROUNDING) + ROUNDING).astype(int)
    return whole, np.maximum(0.0, periods - whole)


def delay_capacity(delay_s: ArrayLike, period_s: ArrayLike) -> int:
    """Return the length of a history of commands for the longest of some delays."""
    return capacity(int(np.max(split_delay(delay_s, period_s)[0])) + 2)


def fill_lag_step(rows: Rows, duration_s: ArrayLike, time_constant_s: ArrayLike) -> None:
    """Fill first-order lags of all groups over a duration: `LagStep`, or a record with its fields."""
    decay, mean_share = lag_step(duration_s, time_constant_s)
    put(rows, decay=decay, mean_share=mean_share)


def lag_step(duration_s: ArrayLike, time_constant_s: ArrayLike) -> tuple[Array, Array]:
    """Return remaining and mean remaining shares of first-order lags, for each duration and constant."""
    pairs = np.broadcast(duration_s, time_constant_s)
    shares = [_shares(float(duration), float(constant)) for duration, constant in pairs]
    decay, mean_share = np.reshape([*zip(*shares, strict=True)], (2, *pairs.shape))
    return decay, mean_share


def _shares(duration_s: float, time_constant_s: float) -> tuple[float, float]:
    """Return remaining and mean remaining share of the distance to the command."""
    if duration_s == 0:
        return 1.0, 0.0
    if time_constant_s == 0:
        return 0.0, 0.0
    times = duration_s / time_constant_s
    return exp(-times), -expm1(-times) / times
