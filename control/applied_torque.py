"""Applied torque: estimate of the torque over the last control period, from commands, nominal delay and lag.

The nominal delay is n + f periods. Over the period that begins with command k, the amplifiers follow command
k - n - 1 for a share f of the period, then command k - n. The lag is solved exactly over both parts.
"""

from __future__ import annotations

from math import exp, expm1
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.state import push
from spheretwin.models.coil_group import PerGroup, of_each_group
from spheretwin.models.kinematics import generalised_torque
from spheretwin.models.magnetics import rotor_torque

# A delay of a whole number of periods is one to rounding only.
ROUNDING = 1e-9


class LagStep(NamedTuple):
    """First-order lag over a part of a period, with a constant command."""

    decay: NDArray[np.float64]
    """(groups,) remaining share of the distance to the command at the end of the part."""
    mean_share: NDArray[np.float64]
    """(groups,) mean remaining share of that distance."""


class AppliedTorque(NamedTuple):
    """Estimated currents and applied torque."""

    on: bool
    """True if the law, the detector or the prediction uses it; otherwise nothing is computed."""
    fraction: float
    """Share of a period in which the older command acts, f."""
    older_lag: LagStep
    newer_lag: LagStep
    commands: NDArray[np.float64]  # (n + 2, groups) A, newest first
    current: NDArray[np.float64]  # (groups,) A, at the end of the last period
    mean: NDArray[np.float64]  # (groups,) A, over the last period
    torque_S: NDArray[np.float64]  # (3,) N·m, mean over the last period, stator frame
    torque_q: NDArray[np.float64]  # (3,) N·m, the same on the hinges; NaN if `on` is False

    def state_arrays(self) -> tuple[NDArray[np.float64], ...]:
        """Return the arrays that hold the state."""
        return self.commands, self.current, self.torque_q


def applied_torque(
    on: bool, groups: int, period_s: float, delay_s: float, time_constant_s: PerGroup
) -> AppliedTorque:
    """Applied torque at rest: no currents and no pending commands.

    Parameters
    ----------
    on : bool
        Whether it is used.
    groups : int
        Coil groups.
    period_s, delay_s : float, s
        Control period and nominal delay.
    time_constant_s : float or one for each group, s
        Time constant L/R of the lag; 0 for none.
    """
    whole, fraction = split_delay(delay_s if on else 0.0, period_s)
    return AppliedTorque(
        on=on,
        fraction=fraction,
        older_lag=lag_step(fraction * period_s, time_constant_s, groups),
        newer_lag=lag_step((1 - fraction) * period_s, time_constant_s, groups),
        commands=np.zeros((whole + 2, groups)),
        current=np.zeros(groups),
        mean=np.zeros(groups),
        torque_S=np.zeros(3),
        torque_q=np.zeros(3) if on else np.full(3, np.nan),
    )


@allocation_free
def estimate_applied_torque(
    applied_torque: AppliedTorque,
    pose: NDArray[np.float64],
    G: NDArray[np.float64],
    command: NDArray[np.float64],
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
    commands, current, mean, fraction = (
        applied_torque.commands,
        applied_torque.current,
        applied_torque.mean,
        applied_torque.fraction,
    )
    last = commands.shape[0] - 1
    for j in range(command.shape[0]):
        push(commands, j, command[j])
        older, newer = commands[last, j], commands[last - 1, j]
        distance = current[j] - older
        first = older + applied_torque.older_lag.mean_share[j] * distance
        distance = older + applied_torque.older_lag.decay[j] * distance - newer
        mean[j] = fraction * first + (1.0 - fraction) * (
            newer + applied_torque.newer_lag.mean_share[j] * distance
        )
        current[j] = newer + applied_torque.newer_lag.decay[j] * distance
    rotor_torque(G, mean, applied_torque.torque_S)
    generalised_torque(pose, applied_torque.torque_S, applied_torque.torque_q)


def split_delay(delay_s: float, period_s: float) -> tuple[int, float]:
    """Return the whole periods of a delay and the remaining share of a period."""
    periods = delay_s / period_s
    whole = int(periods * (1 + ROUNDING) + ROUNDING)
    return whole, max(0.0, periods - whole)


def lag_step(duration_s: float, time_constant_s: ArrayLike, groups: int) -> LagStep:
    """Return the first-order lag of all groups over a duration."""
    constants_s = of_each_group(time_constant_s, groups).tolist()
    return LagStep(*np.array([_shares(duration_s, constant_s) for constant_s in constants_s]).T.copy())


def _shares(duration_s: float, time_constant_s: float) -> tuple[float, float]:
    """Return remaining and mean remaining share of the distance to the command."""
    if duration_s == 0:
        return 1.0, 0.0
    if time_constant_s == 0:
        return 0.0, 0.0
    times = duration_s / time_constant_s
    return exp(-times), -expm1(-times) / times
