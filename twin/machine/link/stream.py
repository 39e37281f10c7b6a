"""Measurements of a machine as a stream of logs, and the shadow that runs beside a link."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Literal

import numpy as np

from spheretwin.machine.link import frame_format
from spheretwin.machine.link.admission import StreamAdmission
from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.codec import Values
from spheretwin.machine.link.frame_format import DEFAULT_FRAME, Flags
from spheretwin.machine.link.transports import open_transport
from spheretwin.machine.log import COMMANDED, MEASURED, Log
from spheretwin.machine.state_estimation import Shadow
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.telemetry.table import Table
from spheretwin.simulation import sleep_until

ADDRESSES = ("udp://", "serial:")
"""Beginnings of addresses; ``-`` is standard input."""

BLOCK_ROWS = 20
"""Rows that are handled together: at 1 kHz the estimate is at most 20 ms late."""

SILENCE_s = 2.0
"""Silence after the first frame that ends a stream."""


def is_address(source: str) -> bool:
    """Return whether a source of measurements is an address and not a file."""
    return source == "-" or source.startswith(ADDRESSES)


def streamed(
    address: str,
    groups: int,
    frame: str = DEFAULT_FRAME,
    currents: Literal["commanded", "measured"] | None = None,
    key: bytes = b"",
    *,
    stop_requested: Callable[[], bool] = lambda: False,
    now: Callable[[], float] = time.monotonic,
) -> Iterator[Log]:
    """Yield the measurements that arrive at an address, until the end flag, a silence or a stop.

    Parameters
    ----------
    address : str
        UDP port to listen to, serial line, or ``-``.
    groups : int
        Coil groups of the machine.
    frame : str
        Shipped name or TOML file of the frames.
    currents : str, optional
        Kind of the currents: default that of the frames, ``measured`` if they state none.
    key : bytes
        Authenticates the frames; no bytes for none.

    Raises
    ------
    InputError
        The address or the frames cannot be used, or the frames have no times, angles or currents.
    SpheretwinError
        The stream ended before the first block was complete.
    """
    description = frame_format.load(frame)
    format_, kind = description.measurement, currents or description.currents or MEASURED
    if lacking := [name for name in ("time", "angle", "current") if not format_.has(name)]:
        raise InputError(f"frame {frame}: expected measurements with {', '.join(lacking)}, received none")
    channel = FrameChannel(open_transport(address, listening=True), format_, format_, groups, key=key)
    if key:
        channel.admit_by(StreamAdmission())
    frames: list[Values] = []
    yielded, heard_s, ended = 0, None, False
    try:
        while not (ended or stop_requested()):
            if new := channel.receive(0.1):
                heard_s, frames = now(), frames + new
                ended = bool(new[-1].get("flags", 0) & Flags.END)
            elif channel.transport.is_closed or (heard_s is not None and now() - heard_s > SILENCE_s):
                ended = True
            if len(frames) >= BLOCK_ROWS:
                yield _log(frames, kind, address)
                yielded, frames = yielded + len(frames), []
        if len(frames) > 1:
            yield _log(frames, kind, address)
        elif not yielded:
            raise SpheretwinError(
                f"stream {address}: expected frames, received {channel.counts.corrupt} texts that are none"
            )
    finally:
        channel.transport.close()


def played(
    log: Log,
    *,
    stop_requested: Callable[[], bool] = lambda: False,
    now: Callable[[], float] = time.perf_counter,
    wait_until: Callable[[float], object] = sleep_until,
) -> Iterator[Log]:
    """Yield the rows of a log in blocks, each when it would have arrived from the machine."""
    started_s = now() - float(log.t_s[0])
    for first in range(0, len(log), BLOCK_ROWS):
        if stop_requested():
            return
        block = log.rows(first, first + BLOCK_ROWS)
        wait_until(started_s + float(block.t_s[-1]))
        yield block


def _log(frames: list[Values], kind: Literal["commanded", "measured"], name: str) -> Log:
    times, currents, angles = (
        np.array([frame[field] for frame in frames]) for field in ("time", "current", "angle")
    )
    return Log(times.ravel(), currents, angles, kind, name)


class RunningShadow:
    """Shadow beside a link: receives each tick, and estimates block by block.

    Parameters
    ----------
    shadow : Shadow
    """

    def __init__(self, shadow: Shadow) -> None:
        self.shadow = shadow
        self._rows: list[tuple[float, Array, Array]] = []
        self._tables: list[Table] = []

    def advance(self, t_s: float, current_A: Array, angle_rad: Array) -> None:
        """Receive the currents (n,) that were sent at a tick and the angles (3,) at its start."""
        self._rows.append((t_s, np.array(current_A), np.array(angle_rad)))
        if len(self._rows) >= BLOCK_ROWS:
            self._estimate()

    def new(self) -> RunningShadow:
        """Return a shadow of the same machine at its start."""
        return RunningShadow(Shadow(self.shadow.model, self.shadow.settings))

    def telemetry(self) -> Table | None:
        """Return the estimates so far, without a single last row; None if there are none."""
        if len(self._rows) > 1:
            self._estimate()
        if not self._tables:
            return None
        return Table(self._tables[0].signals, np.vstack([table.values for table in self._tables]))

    def _estimate(self) -> None:
        times, currents, angles = zip(*self._rows, strict=True)
        log = Log(np.array(times), np.array(currents), np.array(angles), COMMANDED, "link")
        self._rows.clear()
        self._take(self.shadow.advance(log))

    def _take(self, table: Table) -> None:
        """Store the estimates of a block."""
        self._tables.append(table)
