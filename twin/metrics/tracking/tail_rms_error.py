"""The root mean square of the tracking error once the start is over: in the second half of a run."""

from __future__ import annotations

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned
from spheretwin.twin.metrics.tracking.rms_error import SquaresByPiece


class TailRmsError(Metric):
    """Root mean square of ``error_rad`` of each hinge over the second half of the run, [3] in rad.

    The second half begins at exactly half of the planned ticks, and in a run that ended early within 256
    ticks before its half.
    """

    labels = ANGLES

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        self._squares = SquaresByPiece(planned.ticks)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        self._squares.add(rows["error_rad"])

    def value(self) -> list[float] | None:
        """[3] in rad; None without a row."""
        return self._squares.rms(self._squares.piece(self._squares.rows // 2))
