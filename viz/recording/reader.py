"""Reader of recordings: facts, telemetry bit for bit, events; of an unclosed one all complete data."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import Chunk, RrdReader

from spheretwin.models.base.errors import LONGEST_WORD, InputError, SpheretwinError, shortened, without_breaks
from spheretwin.models.base.files import whole_file
from spheretwin.models.telemetry.signals import COMMON_NAMES
from spheretwin.models.telemetry.status import Event, Level
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.view import View, application
from spheretwin.viz.recording.contents import Contents
from spheretwin.viz.recording.part import total
from spheretwin.viz.recording.recovered_plots import RecoveredPlots
from spheretwin.viz.recording.signals import RATE
from spheretwin.viz.rerun_internals import check_readable, whole_messages

# Recordings have times in whole nanoseconds.
_NS = 1e-9


class Recorded(NamedTuple):
    """Run data of a recording."""

    facts: dict[str, Any]
    """`RunFacts` as JSON has them, and versions."""
    table: Table
    """Telemetry, each column bit for bit."""
    events: list[Event]
    """Its log, in the order of time."""
    whole: bool
    """True if it was closed; otherwise the process was killed, or the end is missing."""
    checked: bool
    """True if it has checksums; they were compared."""


def read(path: Path) -> Recorded:
    """Read a recording of a run.

    Raises
    ------
    InputError
        It is no recording of a run of this package, is damaged, or has no complete tick.
    """
    return _read(path)[0]


def _read(path: Path) -> tuple[Recorded, Contents]:
    contents = Contents(path)
    with _chunks(path) as (chunks, whole):
        for chunk in chunks:
            contents.take(chunk)
        facts, table = contents.facts(), contents.table(ended=whole)
        log = contents.log(ended=whole)
    period_s = float(facts["sections"]["controller"]["period_s"])
    if not len(table) and not whole:
        raise InputError(f"recording {path}: expected at least one complete tick, received none")
    t_s = _exact(np.array([line[0] for line in log], dtype=np.float64), period_s)
    events = [(float(t), Level(level), text) for t, (_, level, text) in zip(t_s, log, strict=True)]
    events.sort(key=lambda event: event[0])
    return Recorded(facts, table, events, whole, contents.checked), contents


def rewrite(path: Path, target: Path) -> Recorded:
    """Write the complete data of a recording as a closed one, with its layout; return its run data.

    Raises
    ------
    InputError, SpheretwinError
        It cannot be read; the file cannot be written.
    """
    recorded, contents = _read(path)
    facts, signals = recorded.facts, contents.signals_at_start()
    own = tuple(signal for signal in signals if signal.name not in COMMON_NAMES)
    groups = next(signal.size for signal in signals if signal.name == "current_A")
    decimated = facts.get(RATE) is not None
    view = View(facts["duration_s"], facts["current_limit_A"], groups, own, live=False, decimated=decimated)
    with _chunks(path) as (chunks, _), whole_file(target) as temporary:
        recording = rr.RecordingStream(application(view))
        recording.set_log_time_enabled(False)
        recording.set_sinks(rr.FileSink(temporary))
        plots = RecoveredPlots()
        recording.send_chunks(plots.gather(chunks))
        plots.complete(recording, view, facts, recorded.table, signals)
        if recorded.checked:  # a closed recording states its numbers of rows and lines
            for entity, count in contents.counts.items():
                recording.log(entity, [total(count)], static=True)
        recording.flush()
        recording.disconnect()
    return recorded


@contextmanager
def _chunks(path: Path) -> Iterator[tuple[Iterable[Chunk], bool]]:
    """Whole chunks of a recording, and whether it was closed."""
    done = 0

    def counted(chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        nonlocal done
        for chunk in chunks:
            yield chunk
            done += 1

    try:
        with whole_messages(path) as (readable, extent), warnings.catch_warnings():
            warnings.simplefilter("ignore", rr.error_utils.RerunWarning)  # a missing footer is reported here
            check_readable(readable, path)
            yield counted(RrdReader(readable).stream()), extent.ended
    except (SpheretwinError, KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic inside Rerun is no `Exception`
        reason = shortened(without_breaks(error), LONGEST_WORD)
        place = f"chunk {done}" if done else "its footer or first chunk"
        raise InputError(
            f"recording {path}: expected one of a run, received one that cannot be read in {place}: {reason}"
        ) from None


def _exact(t_ns: NDArray[np.float64], period_s: float) -> NDArray[np.float64]:
    """Return times of ticks from whole nanoseconds, exact to the last bit: sessions make them as products."""
    return np.round(t_ns * _NS / period_s) * period_s
