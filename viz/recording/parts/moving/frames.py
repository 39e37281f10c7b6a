"""Which ticks of a run are drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table

FRAME_RATE_Hz = 60.0

LARGEST_rad = 1e6
"""Beyond it a pose is none any more, and its sine has no digits left."""


class Frames:
    """Picks the first tick of each frame, chunk by chunk, where it has a pose.

    Parameters
    ----------
    rate_Hz : float
        Of the frames.
    """

    def __init__(self, rate_Hz: float = FRAME_RATE_Hz) -> None:
        self._rate_Hz = rate_Hz
        self._next = 0

    def of(self, rows: Table) -> NDArray[np.bool_]:
        """Whether each row of a chunk is drawn."""
        frame = np.floor(rows["t_s"] * self._rate_Hz + 1e-6).astype(np.int64)
        new = frame >= np.concatenate([[self._next], frame[:-1] + 1])
        self._next = max(self._next, int(frame[-1]) + 1)
        return new & posed(rows)


def posed(rows: Table) -> NDArray[np.bool_]:
    """Whether each row has a pose; the last of a run that diverged may have none."""
    small: NDArray[np.bool_] = np.all(np.abs(rows["q_rad"]) < LARGEST_rad, axis=1)
    return small
