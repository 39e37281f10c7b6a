"""What a run's errors oscillate with, as it is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Spectrum(NamedTuple):
    """Of one run's tracking error about one hinge."""

    frequency_Hz: Array  # (n,) above zero
    amplitude_mrad: Array  # (n,)
    peaks: Sequence[tuple[float, float]]
    """Frequency in Hz and amplitude in mrad of the strongest."""
