"""Joint states on a WebSocket of this machine, by the protocol of Foxglove, as a run or a shadow goes on.

Foxglove, Lichtblick and programs for ROS 2 read them; the messages are those of an exported MCAP file. A page
of any host that a browser of this machine shows can read what is published; nothing can be written.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from spheretwin.models.base.errors import SpheretwinError, without_breaks
from spheretwin.models.base.extras import missing
from spheretwin.models.telemetry.joint_states import (
    DEFINITION,
    ENCODING,
    TYPE,
    MessageEncoder,
    stamps_ns,
    topics_of,
)
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Sink, Table

HOST = "127.0.0.1"


class JointStateServer:
    """Sink of a run that publishes its rows; nobody waits for a client, and a slow one misses rows.

    Parameters
    ----------
    port : int
        0: any that is free.

    Raises
    ------
    InputError
        The package foxglove-sdk is not installed.
    SpheretwinError
        The port cannot be used.
    """

    def __init__(self, port: int) -> None:
        try:
            import foxglove
        except ModuleNotFoundError:
            raise missing("publish", "foxglove-sdk", "machine") from None
        self._context = foxglove.Context()
        self._schema = foxglove.Schema(name=TYPE, encoding="ros2msg", data=DEFINITION.encode())
        self._new_channel: Any = foxglove.Channel
        self._channels: dict[str, Any] = {}
        try:
            self._server = foxglove.start_server(
                name="spheretwin", host=HOST, port=port, context=self._context
            )
        except RuntimeError as error:
            raise SpheretwinError(
                f"publish: expected a free port, received {port}: {without_breaks(error)}"
            ) from None

    @property
    def address(self) -> str:
        """Address for clients."""
        return f"ws://{HOST}:{self._server.port}"

    def write(self, rows: Table) -> None:
        """Publish the rows of one chunk."""
        stamps = stamps_ns(rows["t_s"])
        for name, topic in topics_of(rows).items():
            encoder, channel = MessageEncoder(topic), self._channel(f"/{name}")
            for row, stamp in enumerate(stamps):
                channel.log(encoder.message(row, stamp), log_time=stamp)

    def note(self, t_s: float, text: str) -> None:
        """Ignore a message: joint states have numbers alone."""

    def finish(self, status: Status) -> None:
        """Ignore the final status."""

    def close(self) -> None:
        """Disconnect all clients."""
        self._server.stop()

    def _channel(self, topic: str) -> Any:
        if topic not in self._channels:
            self._channels[topic] = self._new_channel(
                topic, schema=self._schema, message_encoding=ENCODING, context=self._context
            )
        return self._channels[topic]


@contextmanager
def published(port: int | None) -> Iterator[list[Sink]]:
    """Yield the sink that publishes at a port, or none; print its address.

    Raises
    ------
    InputError, SpheretwinError
        As `JointStateServer`.
    """
    if port is None:
        yield []
        return
    server = JointStateServer(port)
    print(f"publish: {server.address}", file=sys.stderr, flush=True)
    try:
        yield [server]
    finally:
        server.close()
