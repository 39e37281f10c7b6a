"""A run as its own file tells it, whichever kind of file: telemetry, recording, or what was left of one."""

from __future__ import annotations

import ast
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.analysis import recovery
from spheretwin.analysis.recovery import hold_rows, ticks_of
from spheretwin.config.active_config import ActiveConfig, initial_config
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.extras import check_recordings
from spheretwin.models.telemetry import joint_states
from spheretwin.models.telemetry.checksums import has_checksums
from spheretwin.models.telemetry.run_record import Change, RunRecord
from spheretwin.models.telemetry.status import Event, Events, Level, Status
from spheretwin.models.telemetry.table import Table, read_parquet
from spheretwin.records.provenance import change_text
from spheretwin.run import Run
from spheretwin.scenario import from_record
from spheretwin.scenario.changes import first_tick, from_now_on
from spheretwin.scenario.reading import validated
from spheretwin.scenario.sections import UserController

_BETWEEN = " set to "


def planned(scenario: Mapping[str, Any], period_s: float, ticks: int) -> Iterator[Change]:
    """Changes that a scenario plans, as far as a run came."""
    for event in scenario.get("event", ()):
        if (tick := first_tick(event["t_s"] / period_s)) < ticks:
            yield Change(tick, event["set"], from_now_on(event["set"], event["value"], event["t_s"]))


def logged(
    log: Sequence[Event], scenario: Mapping[str, Any], period_s: float, ticks: int
) -> tuple[Change, ...]:
    """Changes that a log tells of and no plan; what was set without a line of the log is not among them."""
    expected = [(change.tick, change_text(change)) for change in planned(scenario, period_s, ticks)]
    changes = []
    for t_s, _, text in log:
        name, between, value = text.partition(_BETWEEN)
        tick = round(t_s / period_s)
        if (tick, text) in expected:
            expected.remove((tick, text))
        elif between and all(part.isidentifier() for part in name.split(".")):
            changes.append(Change(tick, name, _value(value)))
    return tuple(changes)


def _value(text: str) -> Any:
    """Return the value that Python writes so, or the text itself."""
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text


# In the metadata of columns that were exported of a recording that does not keep every row.
_RATE = "record_rate_Hz"


@dataclass(frozen=True)
class Reviewed:
    """Content of the file of a run.

    Attributes
    ----------
    path : Path
        The file, or what a killed process left of it.
    record : RunRecord
        Scenario at the start, command journal, versions, and how it ended.
    table : Table
        Its telemetry, as the file has it.
    log : tuple of Event
        Lines that were logged; of a telemetry file, which has no log, none.
    whole : bool
        Whether the file was closed.
    metadata : mapping of str
        The record as a telemetry file keeps it.
    rate_Hz : float or None
        Rows a second that the file keeps beside those that stand out; None for every row.
    checked : bool
        True if the file has checksums; they were compared.
    """

    path: Path
    record: RunRecord
    table: Table
    log: tuple[Event, ...]
    whole: bool
    metadata: Mapping[str, str]
    rate_Hz: float | None = None
    checked: bool = True

    @property
    def period_s(self) -> float:
        """Control period, s."""
        return float(self.record.scenario["controller"]["period_s"])

    @property
    def simulated_s(self) -> float:
        """Time that its rows cover, s."""
        return len(self.every_tick) * self.period_s

    @cached_property
    def every_tick(self) -> Table:
        """A row a tick: where the file does not keep every one, each is held until the next."""
        return hold_rows(self.table, self.period_s) if self.rate_Hz else self.table


def read(path: Path) -> Reviewed:
    """Read a telemetry file, a recording, or what a killed process left of either.

    Raises
    ------
    InputError
        There is none, it is none of these, or not a row of it is whole.
    """
    file = recovery.find_run_file(path)
    try:
        if file.suffix in recovery.RECORDINGS or recovery.is_recording(file):
            return _of_recording(file)
        if file.is_dir():
            with recovery.joined_telemetry(file) as joined:
                table, metadata = read_parquet(joined)
            return _of_telemetry(file, table, metadata, whole=False, checked=recovery.are_checked(file))
        table, metadata = read_parquet(file)
        return _of_telemetry(file, table, metadata, whole=True, checked=has_checksums(file))
    except KeyError as error:
        raise InputError(
            f"review {file}: expected the file of a run, received one without {shown(error.args[0])}"
        ) from None
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError):
        raise InputError(
            f"review {file}: expected the file of a run, received one that cannot be read"
        ) from None


def open_run(path: str | Path) -> Run:
    """Open a telemetry file or a recording as a `Run`, which can be saved, recorded and converted again.

    A law or a trajectory whose file is gone does not prevent it: the scenario then has its name alone.

    Raises
    ------
    InputError
        There is no such file, it is no file of a run, or its model or torque curve is gone.
    """
    recorded = read(Path(path))
    start = _start(recorded)
    status = recorded.record.status or Status.INTERRUPTED
    actuator = start.files.actuator
    return Run(start.scenario, status, recorded.every_tick, math.nan, actuator, record=recorded.record)


def _start(recorded: Reviewed) -> ActiveConfig:
    """Scenario and files of a run; where the law or the trajectory is gone, they are known by name alone."""
    fields = recorded.record.scenario
    try:
        return initial_config(from_record(fields, str(recorded.path)), None, None)
    except InputError:
        start = of_the_actuator(recorded)
    controller = UserController(
        law=str(fields["controller"]["law"]), period_s=recorded.period_s, parameters=()
    )
    described = {"description": str(fields["description"]), "controller": controller}
    return start._replace(scenario=start.scenario.model_copy(update=described))


def of_the_actuator(run: Reviewed) -> ActiveConfig:
    """Return plant, drive, sensors and files of a run; law and trajectory, whose files may be gone, differ.

    Raises
    ------
    InputError
        The scenario is none of this version.
    """
    shared_fields = ("name", "duration", "seed", "plant", "drive")
    fields = {
        **{name: run.record.scenario[name] for name in shared_fields},
        "sensors": run.record.scenario.get("sensors", {}),
        "controller": {"law": "pd", "period_s": run.period_s},
        "trajectory": {"shape": "hold"},
    }
    return initial_config(validated(fields, str(run.path)), None, None)


def _of_telemetry(
    path: Path, table: Table, metadata: dict[str, str], *, whole: bool, checked: bool
) -> Reviewed:
    _check_times(path, table)
    rate_Hz = float(metadata[_RATE]) if _RATE in metadata else None
    try:
        record = RunRecord.from_metadata(metadata)
    except InputError as error:
        raise InputError(f"review {path}: {error}") from None
    return Reviewed(path, record, table, (), whole, metadata, rate_Hz, checked)


def _of_recording(path: Path) -> Reviewed:
    check_recordings(f"review {path}")
    from spheretwin.viz.recording import reader  # Rerun is slow to import
    from spheretwin.viz.recording.signals import RATE

    facts, table, log, whole, checked = reader.read(path)
    _check_times(path, table)
    statuses = {status.text: status for status in Status}
    scenario, status = _scenario(facts), statuses.get(log[-1][2] if log else "")
    period_s = float(scenario["controller"]["period_s"])
    ticks = int(ticks_of(table, period_s)[-1]) + 1 if len(table) else 0
    journal = logged(log, scenario, period_s, ticks)
    record = RunRecord(scenario, journal, ticks, {}, facts["versions"], status)
    rate_Hz, metadata = facts.get(RATE), record.metadata()
    if rate_Hz:
        metadata = {**metadata, _RATE: repr(rate_Hz)}
    return Reviewed(path, record, table, tuple(log), whole, metadata, rate_Hz, checked)


def _check_times(path: Path, table: Table) -> None:
    """Refuse rows out of their order: only damage makes them so."""
    t_s = table["t_s"]
    if not (np.all(np.isfinite(t_s)) and np.all(t_s[1:] > t_s[:-1])):
        raise InputError(f"review {path}: expected rows whose times rise, received others: it is damaged")


def _scenario(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Scenario by section, as JSON has it, from what a recording says of it."""
    sections = json.loads(json.dumps(facts["sections"]))
    return {"name": facts["name"], "description": facts["description"], **sections.pop("run"), **sections}


def events(run: Reviewed) -> list[Event]:
    """Events of a run in the order of time, its end last: the same from either of its files."""
    ended = run.record.status
    if run.log:
        events, end = list(run.log[:-1] if ended else run.log), list(run.log[-1:] if ended else ())
    else:
        log = Events()
        events = log.of(run.every_tick) if len(run.table) else []
        events += [(change.tick * run.period_s, Level.INFO, change_text(change)) for change in _changes(run)]
        end = [log.end(ended)] if ended else []
    return [*sorted(events, key=lambda event: (event[0], event[2])), *end]


def _changes(run: Reviewed) -> Iterator[Change]:
    """Changes that its scenario planned and that it came to, and those that were made by hand."""
    yield from planned(run.record.scenario, run.period_s, len(run.every_tick))
    yield from run.record.journal


KINDS = (".csv", ".mat", ".h5", ".parquet", ".mcap")


def check(path: Path) -> None:
    """Refuse a file of another kind.

    Raises
    ------
    InputError
        Its name does not end in one that is known.
    """
    if path.suffix not in KINDS:
        raise InputError(
            "command line: expected --export FILE.csv, FILE.mat, FILE.h5, FILE.parquet or FILE.mcap,"
            f" received {shown(str(path))}"
        )


def export(run: Reviewed, path: Path) -> None:
    """Write all columns of a run, a scalar column for each number.

    A MATLAB or HDF5 file has a matrix for each signal. A Parquet file is again the file of a run. CSV has
    each number as Python writes it, which loses no bit. MCAP has times to 1 ns, the angles and rates of the
    controller as topic ``angles``, the commanded currents as ``currents`` and all other columns as
    ``telemetry``.

    Raises
    ------
    InputError, SpheretwinError
        The file cannot be written; what was there before is untouched.
    """
    if path.suffix == ".parquet":
        run.table.scalars().write_parquet(path, run.metadata)
    elif path.suffix == ".mcap":
        joint_states.write(path, run.table["t_s"], joint_states.topics_of(run.table), run.metadata)
    elif path.suffix == ".mat":
        run.table.write_mat(path, run.metadata)
    elif path.suffix == ".h5":
        run.table.write_hdf5(path, run.metadata)
    else:
        run.table.write_csv(path)
