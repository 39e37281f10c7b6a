"""Live view of a run: Rerun's web viewer, reachable from this machine only."""

from __future__ import annotations

import rerun as rr

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry.run_record import RunFacts
from spheretwin.models.telemetry.signals import Signal
from spheretwin.viz.decimation import RowSelection
from spheretwin.viz.layout.layout import opening_layout
from spheretwin.viz.layout.view import LIVE_WINDOW_S, OVERVIEW
from spheretwin.viz.recording.stream import Stream
from spheretwin.viz.recording.viewer_server import Broadcast, ViewerServer
from spheretwin.viz.rerun_internals import HEADER_BYTES, messages

# Recorded together: a viewer that draws in software on busy cores takes no more than some twenty entities a
# second. With four times as many it was 22 s late after half a minute, with these 2 s.
_TOGETHER_S = 1.0


class LiveView(Stream):
    """Takes a run's telemetry chunk by chunk and shows it to any number of viewers.

    The run waits for no viewer: viewers read a bounded buffer in memory, and one that is too far
    behind continues with the newest data. The page answers as soon as the object exists.

    Parameters
    ----------
    actuator, signals, facts, shown, window_s
        As for `Stream`.

    Raises
    ------
    InputError
        A mesh of the model cannot be read.
    SpheretwinError
        Rerun's viewer is not there.
    """

    def __init__(
        self,
        actuator: Actuator,
        signals: tuple[Signal, ...],
        facts: RunFacts,
        *,
        shown: str = OVERVIEW,
        window_s: float = LIVE_WINDOW_S,
    ) -> None:
        super().__init__(actuator, signals, facts, RowSelection(), live=True, shown=shown, window_s=window_s)
        self._together = max(1, round(_TOGETHER_S / facts.sections["controller"]["period_s"]))
        self._bytes = rr.binary_stream(self.recording)
        self._broadcast = Broadcast()
        self._begun = False
        self._server = ViewerServer(self._broadcast)
        self.begin()

    @property
    def address(self) -> str:
        """Page to open in a browser."""
        return self._server.address

    def connect(self) -> None:
        """Send the layout before all else."""
        self.recording.send_blueprint(opening_layout(self.view))

    def due(self) -> int:
        """Rows that are recorded together."""
        return self._together

    def send(self) -> None:
        """Send viewers the data recorded since the last call."""
        encoded = self._bytes.read() or b""
        if not self._begun:
            self._begun = True
            self._broadcast.begin(encoded[:HEADER_BYTES] + messages(encoded))
        elif piece := messages(encoded):
            self._broadcast.send(piece)

    def complete(self) -> None:
        """Stop the server.

        Raises
        ------
        SpheretwinError
            Some of the view could not be made.
        """
        self._broadcast.end()
        self._server.close()
        self.recording.disconnect()
        if self.fault:
            raise SpheretwinError(f"live view: {self.fault}")
