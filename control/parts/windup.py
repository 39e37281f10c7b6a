"""Anti-windup by back-calculation: an integral is moved by what was given beyond what was asked for.

What was given is the torque of the last period as the controller believes it; what was asked for then,
`control.parts.asked` has kept.
"""

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.law import Known


def tracking_rate(rate: NDArray[np.float64], known: Known) -> NDArray[np.float64]:
    """Rates of back-calculation (1/s), none faster than the tick can follow."""
    return np.minimum(rate, 1 / known.period_s)
