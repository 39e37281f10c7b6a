"""The current drive: each group follows its command through the lag of its inductance."""

from math import exp, expm1
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free


class Drive(NamedTuple):
    """First-order lag, solved exactly over one physics step with the command held."""

    decay: float
    """Share of the distance to the command that is left after a step."""
    mean_share: float
    """Share of that distance that is left on average over the step."""
    current_limit_A: float
    """Of the amplifiers, whatever is asked of them."""


def drive(time_constant_s: float, step_s: float, current_limit_A: float) -> Drive:
    """Drive for a time constant L/R (s; 0 for ideal amplifiers), a physics step (s) and a limit (A)."""
    if time_constant_s == 0:
        return Drive(0.0, 0.0, current_limit_A)
    steps = step_s / time_constant_s
    return Drive(exp(-steps), -expm1(-steps) / steps, current_limit_A)


@allocation_free
def advance(
    drive: Drive,
    command: NDArray[np.float64],
    current: NDArray[np.float64],
    mean: NDArray[np.float64],
) -> None:
    """Advance the currents by one physics step.

    Parameters
    ----------
    drive : Drive
        Lag of the groups.
    command : (n,) array, A
        Held over the step; the amplifiers follow it as far as their limit.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Mean over the step, which is what acts on the rotor.
    """
    limit = drive.current_limit_A
    for j in range(command.shape[0]):
        target = min(max(command[j], -limit), limit)
        distance = current[j] - target
        mean[j] = target + drive.mean_share * distance
        current[j] = target + drive.decay * distance
