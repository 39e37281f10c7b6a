"""A run as a Rerun recording: written to a file, watched live, or both."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Semaphore
from types import TracebackType
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.files import OutputFile
from spheretwin.models.base.wording import without_breaks
from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.models.telemetry.signals import COMMON_NAMES, Signal
from spheretwin.models.telemetry.status import Level, Status, named
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.recording import blueprint, scene
from spheretwin.viz.recording.blueprint import View
from spheretwin.viz.recording.described import COMPLETE, facts_as_json, signal_as_json
from spheretwin.viz.recording.events import Event, Events
from spheretwin.viz.recording.file_pipe import PIPE_PATHS, FilePipe
from spheretwin.viz.recording.live import Viewer
from spheretwin.viz.recording.states import StateChanges

Index = list[rr.TimeColumn]

# What only the eye needs: poses, coil colours, traces.
FRAME_RATE_Hz = 60.0

# Chunks handed over and not yet recorded; beyond these a run waits for its recorder, so that a long one
# does not gather in memory.
PENDING_CHUNKS = 3

# Rerun keeps some bytes of each chunk to the end of a recording. Chunks therefore grow with it, up to this.
MOST_ROWS = 12_288

_SCALARS = next(iter(rr.Scalars.columns(scalars=np.zeros(1)))).component_descriptor()


class Recorder:
    """Takes a run's telemetry chunk by chunk and streams it to Rerun.

    Every signal is recorded at the rate of the control ticks, bit for bit; poses, coil colours and traces
    at 60 Hz. The file appears under its name when the recording closes; until then it is hidden, under a
    name of its own that ends in ``.part``.

    All work is done by one thread beside the simulation, which leaves the interpreter free while its
    compiled loop runs. What goes wrong there ends the recording and is raised by `close`, so that the run
    itself goes on.

    Parameters
    ----------
    actuator : Actuator
        Drawn; has as many groups as the telemetry has currents.
    signals : tuple of Signal
        Columns of the telemetry.
    facts : RunFacts
        For the text panel, the axes and the drawing.
    path : Path, optional
        Recording to write.
    live : bool
        Serve a viewer on 127.0.0.1.

    Raises
    ------
    InputError
        A mesh of the model cannot be read, or no file can be put at `path`; nothing is left there.
    """

    def __init__(
        self,
        actuator: Actuator,
        signals: tuple[Signal, ...],
        facts: RunFacts,
        *,
        path: Path | None = None,
        live: bool = False,
    ) -> None:
        rr.set_strict_mode(True)  # otherwise a mistake is a warning, and its data are dropped
        self._actuator, self._facts = actuator, facts
        scene.read_meshes(facts.mjcf)  # a run needs no mesh, and would find out only now that one is missing
        self._path = path
        self._events = Events()
        self._next_frame = self._handed_over = 0
        self._waiting: list[Table] = []
        self._last_tips: dict[str, NDArray[np.float64]] = {}
        self._states = StateChanges()
        self._described: set[str] = set()
        own = tuple(signal for signal in signals if signal.name not in COMMON_NAMES)
        view = View(facts.duration_s, facts.current_limit_A, len(actuator.groups), own, live)
        self._recording = rr.RecordingStream(blueprint.application(view))
        self._recording.set_log_time_enabled(False)  # simulated time is the only one that means anything
        self._output = OutputFile(path) if path else None
        self._pipe = _pipe_to(self._output) if self._output and PIPE_PATHS.is_dir() else None
        self.viewer = Viewer() if live else None
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="recorder")
        self._room = Semaphore(PENDING_CHUNKS)
        self._fault: str | None = None
        self._closed = False
        self._submit(self._connect, signals, view)

    def _connect(self, signals: tuple[Signal, ...], view: View) -> None:
        """Open the sinks, log all that stays the same, then let a viewer in."""
        facts = self._facts
        sinks: list[Any] = []
        if self._output:
            sinks.append(rr.FileSink((self._pipe or self._output).path))
        if self.viewer:
            sinks.append(self.viewer.sink)
        self._recording.set_sinks(*sinks, default_blueprint=blueprint.layout(view))
        self._recording.send_recording_name(f"{facts.name}, {facts.law}")
        scene.log_static(self._recording, self._actuator, facts.mjcf, facts.payload_kg)
        blueprint.log_styles(self._recording, signals)
        text = rr.TextDocument(_as_markdown(facts), media_type=rr.MediaType.MARKDOWN)
        self._recording.log(blueprint.SCENARIO, text, static=True)
        self._recording.log(blueprint.SCENARIO, facts_as_json(facts), static=True)
        self._describe(signals)
        if self.viewer:
            self.viewer.start()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def write(self, rows: Table) -> None:
        """Record the rows of one chunk, which must not change any more; wait while many are pending."""
        if not len(rows):
            return
        if self._waiting and rows.signals != self._waiting[-1].signals:
            self._hand_over()
        self._waiting.append(rows)
        due = 0 if self.viewer else min(self._handed_over // 4, MOST_ROWS)
        if sum(map(len, self._waiting)) >= due:
            self._hand_over()

    def note(self, t_s: float, text: str) -> None:
        """Record what happened before the tick at `t_s`."""
        self._hand_over()
        self._submit(lambda: self._log([(t_s, Level.INFO, text)]))

    def finish(self, status: Status) -> None:
        """Record how the run ended."""
        ending = named(status)  # a name that is none is told here, not in the recorder's thread
        self._hand_over()
        self._submit(lambda: self._log([self._events.end(ending)]))

    def close(self) -> None:
        """Complete the file and give it its name; end the live viewer. A second time does nothing.

        Raises
        ------
        SpheretwinError
            Some of the recording could not be made or written; what there is of it keeps ``.part``.
        """
        if self._closed:
            return
        self._closed = True
        self._hand_over()
        self._submit(self._recording.flush)
        self._worker.shutdown()
        self._recording.disconnect()
        if self._pipe:
            self._pipe.close()
        if self.viewer:
            self.viewer.close()
        if self._pipe and self._pipe.error:
            self._fault = self._pipe.error.strerror or f"{self._pipe.error!r}"
        if self._fault and self._output:
            raise SpheretwinError(
                f"recording: {self._path} could not be completed, {self._fault};"
                f" what there is of it is in {self._output.path}"
            )
        if self._fault:
            raise SpheretwinError(f"recording: live view: {self._fault}")
        if self._output:
            self._keep(self._output)

    def _keep(self, output: OutputFile) -> None:
        try:
            output.keep()
        except SpheretwinError as error:
            raise SpheretwinError(f"{error}; the recording is in {output.path}") from None

    def _hand_over(self) -> None:
        """Give what is waiting to the worker as one chunk."""
        if not self._waiting:
            return
        waiting, self._waiting = self._waiting, []
        rows = Table(waiting[0].signals, np.concatenate([table.values for table in waiting]))
        self._handed_over += len(rows)
        self._submit(self._write, rows)

    def _submit(self, work: Callable[..., None], *arguments: Any) -> None:
        self._room.acquire()
        self._worker.submit(self._perform, work, *arguments)

    def _perform(self, work: Callable[..., None], *arguments: Any) -> None:
        """Do one piece of work, unless one before it has failed."""
        try:
            if not self._fault:
                work(*arguments)
        except BaseException as error:  # a panic inside Rerun is no `Exception`
            self._fault = without_breaks(error) or type(error).__name__
        finally:
            self._room.release()

    def _write(self, rows: Table) -> None:
        index = _time_index(rows["t_s"])
        self._describe(rows.signals)
        # The times last: rows that have them are whole, wherever a killed process left off.
        for signal in sorted(rows.signals, key=lambda signal: signal.name == COMPLETE):
            column = _scalars(rows[signal.name], signal.size)
            self._recording.send_columns(blueprint.entity(signal.name), index, [column])
        self._write_frames(rows)
        for entity, t_s, states in self._states.of(rows):
            self._recording.send_columns(entity, _time_index(t_s), rr.StateChange.columns(state=states))
        self._log(self._events.of(rows))
        if not self.viewer:
            self._recording.flush()  # encode it here, beside the loop, rather than all at the end

    def _describe(self, signals: tuple[Signal, ...]) -> None:
        """Say of signals that come for the first time what they are; a change of law may bring some."""
        new = [signal for signal in signals if signal.name not in self._described]
        for signal in new:
            described = signal_as_json(len(self._described), signal)
            self._recording.log(blueprint.entity(signal.name), described, static=True)
            self._described.add(signal.name)
        if new and not self.viewer:
            self._recording.flush()  # before their rows: what a killed process leaves says what they are

    def _write_frames(self, rows: Table) -> None:
        """Poses, coil colours and traces of the ticks that fall on a frame."""
        t = rows["t_s"]
        frame = np.floor(t * FRAME_RATE_Hz + 1e-6).astype(np.int64)
        new = frame >= np.concatenate([[self._next_frame], frame[:-1] + 1])
        if not np.any(new):
            return
        self._next_frame = int(frame[-1]) + 1
        index, q = _time_index(t[new]), rows["q_rad"][new]
        for body, quaternion in scene.body_quaternions(q).items():
            # Translation too in every row: a row that has only one of the two resets the other.
            pose = rr.Transform3D.columns(translation=np.zeros((len(q), 3)), quaternion=quaternion)
            self._recording.send_columns(f"{scene.WORLD}/{body}", index, pose)
        self._recording.send_columns(scene.COILS, index, self._coil_colours(rows["current_A"][new]))
        self._send_trace(scene.TIP, index, q)
        self._send_trace(scene.TIP_DESIRED, index, rows["q_ref_rad"][new])

    def _coil_colours(self, current_A: NDArray[np.float64]) -> rr.ComponentColumnList:
        colours = palette.current_colours(current_A, self._facts.current_limit_A)  # (n, groups, 3)
        coils = np.empty((len(current_A), len(self._actuator.coil_axes), 3), dtype=np.uint8)
        for side in range(2):  # both coils of a group carry its current
            coils[:, self._actuator.groups[:, side]] = colours
        return rr.Mesh3D.columns(albedo_texture_buffer=coils.reshape(len(coils), -1))

    def _send_trace(self, entity: str, index: Index, q: NDArray[np.float64]) -> None:
        """One short segment a frame; the view shows those of the last seconds."""
        tips = scene.shaft_tip(q, self._actuator)
        before = np.concatenate([self._last_tips.get(entity, tips[:1]), tips[:-1]])
        self._last_tips[entity] = tips[-1:]
        segments = np.stack([before, tips], axis=1)  # (n, 2, 3)
        self._recording.send_columns(entity, index, rr.LineStrips3D.columns(strips=_strips(segments)))

    def _log(self, events: list[Event]) -> None:
        if events:
            t_s, level, text = zip(*events, strict=True)
            lines = rr.TextLog.columns(text=list(text), level=list(level))
            self._recording.send_columns(blueprint.EVENTS, _time_index(np.array(t_s)), lines)


def _pipe_to(output: OutputFile) -> FilePipe:
    try:
        return FilePipe(output.path)
    except OSError as error:
        output.discard()
        raise InputError(f"output: expected a writable path, {error}") from None


def _scalars(values: NDArray[np.float64], size: int) -> rr.ComponentColumn:
    """What `rr.Scalars.columns` makes of (n, size) values, at half its price."""
    batch = rr.components.ScalarBatch(values.ravel())
    return rr.ComponentColumn(_SCALARS, batch, offsets=size * np.arange(len(values) + 1, dtype=np.int32))


def _strips(segments: NDArray[np.float64]) -> pa.Array:
    """Arrow form of equally long line strips (n, points, 3); Rerun's own conversion takes them one by one."""
    kind = rr.components.LineStrip3DBatch([]).as_arrow_array().type
    flat = pa.array(segments.ravel().astype(np.float32))
    points = pa.FixedSizeListArray.from_arrays(flat, type=kind.value_type)
    starts = np.arange(len(segments) + 1, dtype=np.int32) * segments.shape[1]
    return pa.ListArray.from_arrays(pa.array(starts), points, type=kind)


def _time_index(t_s: NDArray[np.float64]) -> Index:
    """Times in whole nanoseconds: Rerun would cut the fraction of seconds off, a nanosecond too early."""
    nanoseconds = np.round(t_s * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn(blueprint.TIMELINE, duration=nanoseconds)]


def _as_markdown(facts: RunFacts) -> str:
    """All that the run depends on, as a table for each section."""
    lines = [f"# {facts.name}", "", facts.description, ""]
    for title, fields in facts.sections.items():
        lines += [f"## {title}", "", "| field | value |", "|---|---|"]
        lines += [f"| {key} | {'' if value is None else value} |" for key, value in fields.items()]
        lines.append("")
    return "\n".join(lines)
