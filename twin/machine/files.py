"""Files of logs: Parquet, CSV and MCAP as columns of numbers, read with a column map and written."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import types

from spheretwin.machine import columns as column_maps
from spheretwin.machine import csv_files
from spheretwin.machine.columns import ColumnMap
from spheretwin.machine.log import ACCEPTED, CONDITIONS, CURRENTS, Log, conditions_of, log_signals
from spheretwin.machine.raw_table import RawTable, repeated_names
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.files import regular_file, whole_file
from spheretwin.models.telemetry import joint_states
from spheretwin.models.telemetry.checksums import METADATA, open_parquet, unreadable
from spheretwin.models.telemetry.joint_states import ANGLE_NAMES, Topic, group_names
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table


def read(
    path: str | Path,
    columns: ColumnMap | Mapping[str, Any] | str | Path | None = None,
    accepted: tuple[str, ...] = (),
) -> Log:
    """Read a log from a Parquet, CSV or MCAP file.

    Parameters
    ----------
    path : str or Path
        The file; vectors of Parquet and joint states of MCAP become a column for each number. Its first bytes
        tell the format; without those of Parquet or MCAP it is CSV.
    columns : ColumnMap, mapping, str or Path, optional
        Column map, its fields, or its TOML file; default: the columns that this package writes, also the
        telemetry of a run.
    accepted : tuple of str
        Findings of `check` that are accepted, in addition to those that the file names.

    Raises
    ------
    InputError
        The file cannot be read, lacks a column, or a name is no finding.
    """
    from spheretwin.machine.findings import check_names  # imports an optimiser, which is slow

    if columns is None or isinstance(columns, ColumnMap):
        column_map = columns
    elif isinstance(columns, str | Path):
        column_map = column_maps.load(columns)
    else:
        column_map = column_maps.of_fields(columns)
    path = Path(path)
    table = _read_table(path, column_map)
    if column_map is None:
        column_map = column_maps.default(table, table.metadata.get(CURRENTS))
    try:
        stated = _conditions(table.metadata)
        before = tuple(json.loads(table.metadata.get(ACCEPTED, "[]")))
    except ValueError:
        raise InputError(f"log {path}: expected conditions and accepted findings as JSON") from None
    column_map = column_map.model_copy(update={"conditions": {**stated, **column_map.conditions}})
    return column_map.log(table, check_names((*before, *accepted)))


def write(log: Log, path: str | Path) -> None:
    """Write a log as Parquet, CSV or MCAP, with the columns that `read` expects by default.

    CSV has the numbers alone; the others also have conditions and accepted findings. MCAP has times to 1 ns.

    Raises
    ------
    InputError, SpheretwinError
        The file cannot be written.
    """
    path, groups = Path(path), group_names(log.current_A.shape[1])
    metadata = {
        CURRENTS: log.currents,
        CONDITIONS: json.dumps(dict(log.conditions)),
        ACCEPTED: json.dumps(log.accepted),
    }
    if path.suffix.lower() == ".mcap":
        topics = {
            "angles": Topic(ANGLE_NAMES, {"position": log.angle_rad}),
            "currents": Topic(groups, {"effort": log.current_A}),
        }
        joint_states.write(path, log.t_s, topics, metadata)
        return
    signals = log_signals(len(groups), (log.currents,))
    table = Table(signals, np.column_stack([log.t_s, log.angle_rad, log.current_A])).scalars()
    if path.suffix.lower() == ".parquet":
        table.write_parquet(path, metadata)
    elif path.suffix.lower() == ".csv":
        with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(table)
            writer.writerows(map(repr, row) for row in table.values.tolist())
    else:
        raise InputError(f"log: expected a file .parquet, .csv or .mcap, received {shown(str(path))}")


def _conditions(metadata: Mapping[str, str]) -> dict[str, Any]:
    """Return the conditions that a log states, or those of the scenario of telemetry."""
    if CONDITIONS in metadata or "scenario" not in metadata:
        return dict(json.loads(metadata.get(CONDITIONS, "{}")))
    return conditions_of(json.loads(metadata["scenario"]).get("plant", {}).get("payload_kg", 0.0))


def _read_table(path: Path, column_map: ColumnMap | None) -> RawTable:
    """Return the columns of a file, whose first bytes tell its format."""
    try:
        with regular_file(path).open("rb") as file:
            start = file.read(8)
    except OSError as error:
        raise unreadable(path, error, "a log") from None
    if start.startswith(joint_states.MAGIC):
        return _read_mcap(path, column_map)
    if start.startswith(_PARQUET):
        return _read_parquet(path)
    for beginning, (what, advice) in OTHER_FORMATS.items():
        if start.startswith(beginning):
            raise InputError(f"log {path}: expected CSV, Parquet or MCAP, received {what}: {advice}")
    if path.suffix == ".rrd":
        raise unreadable(path, ValueError("received other bytes"), "a log")
    if path.suffix.lower() in (".mcap", ".parquet"):
        raise InputError(f"log {path}: expected {path.suffix[1:]}, received other bytes at its beginning")
    return csv_files.read(path, column_map.csv if column_map else None)


_PARQUET = b"PAR1"

OTHER_FORMATS = {
    b"PK\x03\x04": ("a ZIP archive, such as a workbook of Excel", "save it as CSV"),
    b"\xd0\xcf\x11\xe0": ("an old workbook of Excel", "save it as CSV"),
    b"SQLite f": ("an SQLite database, such as a bag of ROS 2", "`ros2 bag convert` writes MCAP"),
    b"#ROSBAG": ("a bag of ROS 1", "`mcap convert` writes MCAP"),
    b"\x89HDF": ("HDF5, such as a file of MATLAB", "`writetimetable` or pandas write CSV or Parquet"),
    b"MATLAB": ("a file of MATLAB", "`writetimetable` writes CSV"),
    b"MDF  ": ("a measurement file MDF", "asammdf exports CSV and Parquet"),
    b"TDSm": ("a file TDMS of LabVIEW", "npTDMS and DIAdem export CSV"),
    b"\xff\xff\xff\xff": (
        "an Arrow stream, such as a part of a killed run",
        "`spheretwin recover` merges parts",
    ),
    b"ARROW1": ("an Arrow file", "`pyarrow.parquet.write_table` writes Parquet"),
}
"""Formats of other programs by their first bytes, and how to convert them."""


def _read_mcap(path: Path, column_map: ColumnMap | None) -> RawTable:
    time = column_map.time.column if column_map else joint_states.STAMPS
    if time not in (times := (joint_states.STAMPS, joint_states.LOG_TIME, joint_states.PUBLISH_TIME)):
        raise InputError(f"log {path}: expected time.column as one of {', '.join(times)}, received {time}")
    names: tuple[str, ...] = column_maps.MCAP_TOPICS
    if column_map:
        names = (*column_map.angles.columns, *column_map.currents.columns)
    states = joint_states.read(path, time, names)
    columns = {time: states.time_ns, **states.columns}
    return RawTable(str(path), columns, {time: "ns"}, states.metadata, states.notes)


def _read_parquet(path: Path) -> RawTable:
    try:
        with open_parquet(path) as file:
            table = file.read(use_threads=False)
        metadata = {
            name.decode(): text.decode()
            for name, text in (table.schema.metadata or {}).items()
            if name.decode() not in METADATA
        }
        columns = [part for field in table.schema for part in _scalars(field, table[field.name])]
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        if not _has_end(path):
            raise InputError(
                f"log {path}: expected Parquet with its end, received none: its writer was killed, and its"
                " rows cannot be read without it"
            ) from None
        raise unreadable(path, error, "columns of numbers") from None
    names = [name for name, _ in columns]
    return RawTable(str(path), dict(columns), {}, metadata, (), repeated_names(names))


def _has_end(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-len(_PARQUET), 2)
        return file.read() == _PARQUET


MOST_ENTRIES = 1024
"""Length of vectors beyond which they are not read."""


def _scalars(field: pa.Field, column: pa.ChunkedArray) -> Iterator[tuple[str, Any]]:
    """Yield name and content of a column; a column for each entry of a vector or a structure."""
    kind = field.type
    if types.is_struct(kind):
        for entry in kind:
            yield from _scalars(
                entry.with_name(f"{field.name}.{entry.name}"), pc.struct_field(column, entry.name)
            )
    elif types.is_fixed_size_list(kind) or types.is_list(kind) or types.is_large_list(kind):
        if not (types.is_integer(kind.value_type) or types.is_floating(kind.value_type)):
            return
        lengths = pc.fill_null(pc.list_value_length(column), 0).to_numpy()
        size = kind.list_size if types.is_fixed_size_list(kind) else int(lengths.max(initial=0))
        if not 0 < size <= MOST_ENTRIES:
            return
        labels = (field.metadata or {}).get(b"labels", b"").decode()
        signal = Signal(field.name, "", size, "", tuple(filter(None, labels.split(","))))
        names = [scalar.name for scalar in signal.scalars()] if size > 1 else [field.name]
        values = np.full((len(column), size), np.nan)
        flat = pc.list_flatten(column).cast(pa.float64(), safe=False)
        values[np.arange(size) < lengths[:, None]] = flat.to_numpy()
        yield from zip(names, values.T, strict=True)
    else:
        yield field.name, column
