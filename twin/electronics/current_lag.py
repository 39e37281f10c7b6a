"""Current lag: amplifiers without a supply, whose currents follow with a first-order lag."""

from __future__ import annotations

from math import exp, expm1
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free


class CurrentLag(NamedTuple):
    """First-order lag, solved exactly over one physics step with the command held."""

    decay: float
    """Share of the distance to the command that remains after a step."""
    mean_share: float
    """Share of that distance that remains on average over the step."""
    current_limit_A: float
    """Limit of the amplifiers, for any command."""


def current_lag(time_constant_s: float, step_s: float, current_limit_A: float) -> CurrentLag:
    """Return the lag for a time constant L/R (s; 0: ideal amplifiers), a physics step (s) and a limit (A)."""
    if time_constant_s == 0:
        return CurrentLag(0.0, 0.0, current_limit_A)
    steps = step_s / time_constant_s
    return CurrentLag(exp(-steps), -expm1(-steps) / steps, current_limit_A)


@allocation_free
def advance_lag(
    lag: CurrentLag,
    command: NDArray[np.float64],
    current: NDArray[np.float64],
    mean: NDArray[np.float64],
) -> None:
    """Advance the currents by one physics step.

    Parameters
    ----------
    lag : CurrentLag
        Lag of the groups.
    command : (n,) array, A
        Held over the step; the amplifiers follow it up to their limit.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Result: mean over the step, which acts on the rotor.
    """
    limit = lag.current_limit_A
    for j in range(command.shape[0]):
        target = min(max(command[j], -limit), limit)
        distance = current[j] - target
        mean[j] = target + lag.mean_share * distance
        current[j] = target + lag.decay * distance
