"""Files of logs: Parquet, CSV and MCAP as columns of numbers, read with a column map and written."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.machine import columns as column_maps
from spheretwin.machine.columns import ColumnMap
from spheretwin.machine.log import COMMANDED, MEASURED, Log
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.files import regular_file, whole_file
from spheretwin.models.telemetry import joint_states
from spheretwin.models.telemetry.checksums import METADATA, open_parquet, unreadable
from spheretwin.models.telemetry.joint_states import ANGLE_NAMES, Topic, group_names
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.models.telemetry.table import Table

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]

CURRENT_SIGNALS = {COMMANDED: "current_command_A", MEASURED: "current_measured_A"}
CURRENTS, CONDITIONS, ACCEPTED = "currents", "conditions", "accepted"
"""Metadata of a log in Parquet and MCAP."""


def read(
    path: str | Path,
    columns: ColumnMap | Mapping[str, Any] | str | Path | None = None,
    accepted: tuple[str, ...] = (),
) -> Log:
    """Read a log from a Parquet, CSV or MCAP file.

    Parameters
    ----------
    path : str or Path
        The file; vectors of Parquet and joint states of MCAP become a column for each number.
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
    from spheretwin.machine.findings import check_names  # imports an optimiser, which an export does not need

    path = Path(path)
    numbers, metadata = _read_columns(path)
    if columns is None:
        column_map = column_maps.default(tuple(numbers), metadata.get(CURRENTS), str(path))
    elif isinstance(columns, ColumnMap):
        column_map = columns
    elif isinstance(columns, str | Path):
        column_map = column_maps.load(columns)
    else:
        column_map = column_maps.of_fields(columns)
    try:
        stated = json.loads(metadata.get(CONDITIONS, "{}"))
        before = tuple(json.loads(metadata.get(ACCEPTED, "[]")))
    except ValueError:
        raise InputError(f"log {path}: expected conditions and accepted findings as JSON") from None
    column_map = column_map.model_copy(update={"conditions": {**stated, **column_map.conditions}})

    return column_map.log(numbers, str(path), check_names((*before, *accepted)))


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
    if path.suffix == ".mcap":
        topics = {
            "angles": Topic(ANGLE_NAMES, {"position": log.angle_rad}),
            "currents": Topic(groups, {"effort": log.current_A}),
        }
        joint_states.write(path, log.t_s, topics, metadata)
        return
    signals = log_signals(len(groups), (log.currents,))
    table = Table(signals, np.column_stack([log.t_s, log.angle_rad, log.current_A])).scalars()
    if path.suffix == ".parquet":
        table.write_parquet(path, metadata)
    elif path.suffix == ".csv":
        with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(signal.name for signal in table.signals)
            writer.writerows(map(repr, row) for row in table.values.tolist())
    else:
        raise _unknown_kind(path)


def log_signals(groups: int, kinds: tuple[str, ...]) -> tuple[Signal, ...]:
    """Return the signals of a log with the given kinds of currents."""
    labels = tuple(group_names(groups))
    meanings = {
        COMMANDED: "group currents commanded to the amplifiers",
        MEASURED: "group currents as measured",
    }
    return (
        Signal("t_s", "s", 1, "time of the sample"),
        Signal("angle_rad", "rad", 3, "hinge angles as measured", ANGLES),
        *(Signal(CURRENT_SIGNALS[kind], "A", groups, meanings[kind], labels) for kind in kinds),
    )


def _read_columns(path: Path) -> tuple[dict[str, Array], dict[str, str]]:
    """Return the columns of numbers of a file, and its metadata."""
    if path.suffix == ".mcap":
        return joint_states.read(path)
    if path.suffix not in (".parquet", ".csv"):
        raise _unknown_kind(path)
    import pyarrow as pa
    import pyarrow.csv

    try:
        if path.suffix == ".csv":
            table = pyarrow.csv.read_csv(regular_file(path))
        else:
            with open_parquet(path) as file:
                table = file.read(use_threads=False)
        names = table.schema.names
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise InputError(f"log {path}: expected each column once, received {', '.join(twice)} twice")
        metadata = {
            name.decode(): text.decode()
            for name, text in (table.schema.metadata or {}).items()
            if name.decode() not in METADATA
        }
        numbers = {
            name: values
            for field in table.schema
            for name, values in _scalars(field, table[field.name]).items()
        }
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        raise unreadable(path, error, "columns of numbers") from None
    return numbers, metadata


def _scalars(field: pa.Field, column: pa.ChunkedArray) -> dict[str, Array]:
    """Return the numbers of a column by name; none of a column without numbers."""
    import pyarrow as pa

    if pa.types.is_fixed_size_list(field.type):
        size = field.type.list_size
        labels = (field.metadata or {}).get(b"labels", b"").decode()
        signal = Signal(field.name, "", size, "", tuple(filter(None, labels.split(","))))
        values = np.asarray(column.combine_chunks().flatten(), np.float64).reshape(-1, size)
        names = [scalar.name for scalar in signal.scalars()] if size > 1 else [field.name]
        return dict(zip(names, values.T, strict=True))
    # A missing number of Arrow becomes NaN, also in a column without any.
    types = pa.types.is_integer, pa.types.is_floating, pa.types.is_null
    is_number = any(is_type(field.type) for is_type in types)
    return {field.name: column.cast(pa.float64()).to_numpy()} if is_number else {}


def _unknown_kind(path: Path) -> InputError:
    return InputError(f"log: expected a file .parquet, .csv or .mcap, received {shown(str(path))}")
