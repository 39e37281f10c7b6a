"""Anti-windup by back-calculation: an integral is moved by what was given beyond what was asked for.

What was given is the torque of the last period as the controller believes it, and what was asked for then is
as old as the known delay makes it: a share `late` of it one tick older than the rest. A law keeps what it
asked for at the end of its state, newest first.
"""

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.law import Known
from spheretwin.models.base.compiled import allocation_free

# A delay that fits a whole number of periods does so to rounding only.
WHOLE = 1e-9


def lateness(known: Known) -> tuple[float, int]:
    """Share of a period in which the older command still acts, and the numbers of memory that it takes."""
    periods = known.delay_s / known.period_s
    whole = int(periods * (1 + WHOLE) + WHOLE)
    return max(0.0, periods - whole), 3 * (whole + 2)


def tracking_rate(rate: NDArray[np.float64], known: Known) -> NDArray[np.float64]:
    """Rates of back-calculation (1/s), none faster than the tick can follow."""
    return np.minimum(rate, 1 / known.period_s)


@allocation_free
def asked_before(asked: NDArray[np.float64], axis: int, late: float) -> float:
    """Torque (N·m) on an axis that the last period was asked for."""
    last = asked.shape[0] - 3
    return late * asked[last + axis] + (1.0 - late) * asked[last - 3 + axis]


@allocation_free
def remember(asked: NDArray[np.float64], torque: NDArray[np.float64]) -> None:
    """Keep the torque (3,) that is asked for now."""
    for i in range(asked.shape[0] - 1, 2, -1):
        asked[i] = asked[i - 3]
    for axis in range(3):
        asked[axis] = torque[axis]
