"""Telemetry of a run as a table: one row per control tick."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError, did_you_mean
from spheretwin.models.base.extras import missing
from spheretwin.models.base.files import whole_file
from spheretwin.models.telemetry import checksums
from spheretwin.models.telemetry.signals import Signal, merged, offsets, width

if TYPE_CHECKING:
    import pyarrow as pa

    from spheretwin.models.telemetry.status import Status


# The numbers change little from row to row: their bytes are split by significance, then compressed. That
# takes less time and space than a dictionary of values, few of which occur twice.
PARQUET_FORMAT: dict[str, Any] = {
    "compression": "zstd",
    "use_dictionary": False,
    "use_byte_stream_split": True,
}


@cache
def _places(signals: tuple[Signal, ...]) -> dict[str, tuple[int, int]]:
    """Return first column and size of each signal."""
    first = offsets(signals)
    return {signal.name: (first[signal.name], signal.size) for signal in signals}


def allocated(rows: int, columns: int) -> NDArray[np.float64]:
    """Allocate rows of telemetry.

    Raises
    ------
    InputError
        There is not enough memory.
    """
    try:
        return np.empty((rows, columns))
    except (MemoryError, ValueError):  # the latter beyond what an index can hold
        needed = rows * columns * 8 / 2**30
        raise InputError(
            f"telemetry: expected rows that fit in memory, received {needed:.1f} GiB of them"
        ) from None


class Table:
    """Telemetry of a run: ``table["q_rad"]`` is an (n, 3) array, ``table["t_s"]`` an (n,) array.

    Parameters
    ----------
    signals : tuple of Signal
        The columns, in order.
    values : (n, width) array
        One flat row per tick; not copied.
    """

    def __init__(self, signals: tuple[Signal, ...], values: NDArray[np.float64]) -> None:
        if values.ndim != 2 or values.shape[1] != width(signals):
            raise InputError(
                f"telemetry: expected rows of {width(signals)} numbers, received shape {values.shape}"
            )
        self.signals = signals
        self.values = values

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        places = _places(self.signals)
        if name not in places:
            raise InputError(
                f"telemetry: expected one of {', '.join(places)},"
                f" received {name}{did_you_mean(str(name), places)}"
            )
        first, size = places[name]
        return self.values[:, first] if size == 1 else self.values[:, first : first + size]

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def keys(self) -> tuple[str, ...]:
        """Return the names of the columns, in order."""
        return tuple(signal.name for signal in self.signals)

    def rows(self, first: int, last: int) -> Table:
        """Return the rows from `first` to `last`, exclusive (a view)."""
        return Table(self.signals, self.values[first:last])

    def scalars(self) -> Table:
        """Return the same numbers with one column for each, for programs that read no vectors."""
        return Table(tuple(scalar for signal in self.signals for scalar in signal.scalars()), self.values)

    def write_parquet(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Write all columns, their units, `metadata` and checksums, completely or not at all.

        Raises
        ------
        InputError
            No file can be written there.
        SpheretwinError
            Writing failed; an earlier file is unchanged.
        """
        table = self.arrow(metadata)
        checksums.write_parquet(path, table.schema, [table], **PARQUET_FORMAT)

    def write_csv(self, path: Path) -> None:
        """Write a column for each number, each as Python writes it, which loses no bit; errors as above."""
        with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(self.scalars().keys())
            writer.writerows(map(repr, row) for row in self.values.tolist())

    def write_mat(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Write a MATLAB file: a matrix for each signal, its unit, and `metadata`; errors as above."""
        from scipy.io import savemat  # slow to import

        columns = {signal.name: self[signal.name] for signal in self.signals}
        units = {signal.name: signal.unit for signal in self.signals}
        with whole_file(path) as temporary, temporary.open("wb") as file:
            savemat(
                file,
                {**columns, "unit": units, "provenance": dict(metadata)},
                long_field_names=True,
                do_compression=True,
                oned_as="column",
            )

    def write_hdf5(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Write an HDF5 file: a data set for each signal with unit and meaning, and `metadata` in a group.

        Raises
        ------
        InputError
            h5py is not installed, or the file cannot be written there.
        """
        try:
            import h5py
        except ModuleNotFoundError:
            raise missing(f"{path}", "h5py", "hdf5", "for HDF5 files") from None
        with whole_file(path) as temporary, h5py.File(temporary, "w") as file:
            for name, text in metadata.items():
                file[f"provenance/{name}"] = text  # an attribute would have 64 kB at most
            for signal in self.signals:
                data = file.create_dataset(signal.name, data=self[signal.name], compression="gzip")
                data.attrs.update(unit=signal.unit, meaning=signal.meaning, labels=",".join(signal.labels))

    def arrow(self, metadata: Mapping[str, str]) -> pa.Table:
        """Return an Arrow table of the columns; units and descriptions are metadata of the fields."""
        import pyarrow as pa

        fields, columns = [], []
        for signal in self.signals:
            flat = pa.array(np.ascontiguousarray(self[signal.name]).ravel())
            column = flat if signal.size == 1 else pa.FixedSizeListArray.from_arrays(flat, signal.size)
            described = {"unit": signal.unit, "meaning": signal.meaning, "labels": ",".join(signal.labels)}
            if signal.states:
                described["states"] = ",".join(signal.states)
            fields.append(pa.field(signal.name, column.type, nullable=False, metadata=described))
            columns.append(column)
        return pa.table(columns, schema=pa.schema(fields, metadata=dict(metadata)))


def read_parquet(path: Path, *, rows: bool = True) -> tuple[Table, dict[str, str]]:
    """Read a table and the metadata of its file, and compare its checksums.

    Scalar columns that `Table.scalars` made are vectors again.

    Parameters
    ----------
    path : Path
        The file; one of an earlier version has no checksums (`checksums.has_checksums`).
    rows : bool
        If False, the table is empty, and only the end of the file is read.

    Raises
    ------
    InputError
        The file is missing, is not telemetry of this package, is damaged, or has two columns of one name.
    """
    import pyarrow as pa

    try:
        with checksums.open_parquet(path, rows=rows) as file:
            arrow = file.read(use_threads=False) if rows else file.schema_arrow.empty_table()
        signals = tuple(_signal(field) for field in arrow.schema)
        metadata = _texts(arrow.schema.metadata)
    except KeyError as error:
        raise InputError(
            f"telemetry {path}: expected a telemetry file (.parquet) of a run,"
            f" received a column without its {error}"
        ) from None
    except UnicodeDecodeError:
        raise InputError(f"telemetry {path}: expected metadata as text, received other bytes") from None
    except (OSError, pa.ArrowException) as error:
        raise checksums.unreadable(path, error, "a telemetry file (.parquet) of a run") from None
    names = [signal.name for signal in signals]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"telemetry {path}: expected each column once, received {', '.join(twice)} twice")
    parts = [_flat(arrow[signal.name], signal.size) for signal in signals]
    texts = {name: text for name, text in metadata.items() if name not in checksums.METADATA}
    return Table(merged(signals), np.concatenate(parts, axis=1)), texts


def _texts(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    return {name.decode(): text.decode() for name, text in (metadata or {}).items()}


def _signal(field: pa.Field) -> Signal:
    described = _texts(field.metadata)
    size = getattr(field.type, "list_size", 1)
    texts = described["labels"], described.get("states", "")
    labels, states = (tuple(filter(None, text.split(","))) for text in texts)
    return Signal(field.name, described["unit"], size, described["meaning"], labels, states)


def _flat(column: pa.ChunkedArray, size: int) -> NDArray[np.float64]:
    chunk = column.combine_chunks()
    return np.asarray(chunk.flatten() if size > 1 else chunk, dtype=np.float64).reshape(-1, size)


def check_rows(log: NDArray[np.float64], columns: int) -> None:
    """Check that compiled code may write into the rows of a caller's array.

    Raises
    ------
    InputError
        They have another type or width: compiled code would write outside them.
    """
    if isinstance(log, np.ndarray):
        fits = log.shape[1:] == (columns,) and log.dtype == np.float64
        if fits and log.flags.c_contiguous and log.flags.writeable:
            return
    raise InputError(
        f"session: expected contiguous, writeable rows of {columns} float64, received"
        f" {getattr(log, 'dtype', type(log).__name__)} of shape {np.shape(log)}"
    )


class TelemetryBuffer:
    """Sink of a run that stores its rows in memory.

    Parameters
    ----------
    signals : tuple of Signal
        Columns at the start. Columns that a change adds during the run are appended; a column is NaN at
        ticks without it.
    ticks : int
        Planned ticks; the largest number of rows.

    Raises
    ------
    InputError
        There is not enough memory.
    """

    def __init__(self, signals: tuple[Signal, ...], ticks: int) -> None:
        self._table = Table(signals, allocated(ticks, width(signals)))
        self._rows = 0

    @property
    def table(self) -> Table:
        """Rows so far (a view)."""
        return self._table.rows(0, self._rows)

    def write(self, rows: Table) -> None:
        """Append the rows of one chunk."""
        if missing := tuple(signal for signal in rows.signals if signal not in self._table.signals):
            self._widen(missing)
        first, self._rows = self._rows, self._rows + len(rows)
        here = self._table.rows(first, self._rows)
        if rows.signals == here.signals:
            here.values[:] = rows.values
            return
        here.values[:] = np.nan
        for signal in rows.signals:
            here[signal.name][:] = rows[signal.name]

    def note(self, t_s: float, text: str) -> None:
        """Ignore a note: the journal is not part of the rows."""

    def finish(self, status: str) -> None:
        """Ignore the final status."""

    def _widen(self, added: tuple[Signal, ...]) -> None:
        previous = self._table
        signals = previous.signals + added
        self._table = Table(signals, allocated(len(previous), width(signals)))
        self._table.values[:, : previous.values.shape[1]] = previous.values
        self._table.values[:, previous.values.shape[1] :] = np.nan


def saturated(rows: Table) -> NDArray[np.bool_]:
    """Return True for each row in which the current limit reduces the commanded torque."""
    scale = rows["allocation_scale"]
    return (scale > 0) & (scale < 1)


def rank_lost(rows: Table) -> NDArray[np.bool_]:
    """Return True for each row in which the torque matrix of the groups in use has less than rank 3.

    Such a pose has a direction without torque. No currents are commanded then, whatever the limit.
    """
    return np.equal(rows["allocation_scale"], 0)


def with_currents(telemetry: Table, current_A: NDArray[np.float64]) -> Table:
    """Return the telemetry of a shadow with the currents (n, groups) of the log; NaN is 0."""
    currents = Signal("current_A", "A", current_A.shape[1], "group currents")
    values = np.hstack([telemetry.values, np.nan_to_num(current_A)])
    return Table((*telemetry.signals, currents), values)


class Sink(Protocol):
    """Receiver of a run while it runs: a recorder, a progress bar, a file."""

    def write(self, rows: Table) -> None:
        """Receive the rows of one chunk, which do not change later."""

    def note(self, t_s: float, text: str) -> None:
        """Receive a message about a change before the tick at `t_s`; the rows show all other events."""

    def finish(self, status: Status) -> None:
        """Receive the final status."""
