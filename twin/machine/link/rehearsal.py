"""Rehearsal of a run: what its loop will do for the first time is done before the peer is heard.

Imports, compilation, first allocations and first writes of files take 10 to 70 ms: in a loop with a period of
1 ms they would remove the currents.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.codec import Values
from spheretwin.machine.link.transports import StandIn
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Sink, Table
from spheretwin.scenario.sections import ResolvedScenario
from spheretwin.session import Session
from spheretwin.simulation import follow

TICKS = 60
"""Control ticks of a rehearsal: three chunks, and three blocks of the shadow."""


def rehearse(session: Session, sinks: Sequence[Sink]) -> None:
    """Run the first ticks of a session with a stand-in, and one after each event of its scenario."""
    scenario = session.initial_scenario
    follow(session, min(TICKS, scenario.ticks), sinks, short_chunks=True)
    for event in scenario.event:
        if not session.ended:
            session.set(event.set, event.value)
            session.advance(1)


def still_machine(channel: FrameChannel, scenario: ResolvedScenario) -> tuple[FrameChannel, StandIn]:
    """Return a channel to a stand-in of the machine that stays at the initial pose, and the stand-in."""
    still = {
        "angle": np.array(scenario.plant.initial_rad),
        "rate": np.zeros(3),
        "current": np.zeros(channel.groups),
        "temperature": scenario.drive.ambient_degC,
    }

    def measure(command: Values) -> Values:
        number = command.get("sequence")
        return {"sequence": number, "echo": number, "session": command.get("session"), **still}

    return channel.stand_in(measure)


class FileThread:
    """Sink that passes rows to the files of a run in a thread: to write takes longer than a control period.

    Parameters
    ----------
    sinks : sequence of Sink
        Each keeps its errors until it is closed.
    """

    def __init__(self, sinks: Sequence[Sink]) -> None:
        self._sinks = tuple(sinks)
        self._worker = ThreadPoolExecutor(1, "files")
        self._worker.submit(len, ()).result()  # the thread has started

    def write(self, rows: Table) -> None:
        """Pass the rows of one chunk."""
        for sink in self._sinks:
            self._worker.submit(sink.write, rows)

    def note(self, t_s: float, text: str) -> None:
        """Pass a message."""
        for sink in self._sinks:
            self._worker.submit(sink.note, t_s, text)

    def finish(self, status: Status) -> None:
        """Pass the final status, and wait until everything is written."""
        for sink in self._sinks:
            self._worker.submit(sink.finish, status)
        self.close()

    def close(self) -> None:
        """Wait until everything is written; rows that come later are an error."""
        self._worker.shutdown()
