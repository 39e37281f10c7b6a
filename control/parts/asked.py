"""What a law asked for, kept until the torque that came of it is known.

The torque of the last period, as the controller believes it, answers what was asked for as long ago as the
known delay makes it: a share `late` of the period one tick longer ago than the rest. A law keeps what it
asked for at the end of its state, newest first.
"""

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.belief import whole_periods
from spheretwin.control.law import Known
from spheretwin.models.base.compiled import allocation_free


def lateness(known: Known) -> tuple[float, int]:
    """Share of a period in which the older command still acts, and the numbers of memory that it takes."""
    whole, late = whole_periods(known.delay_s, known.period_s)
    return late, 3 * (whole + 2)


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
