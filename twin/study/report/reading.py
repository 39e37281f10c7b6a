"""The table of a study as arrays: a number a row for each figure, values of the axes, laws and statuses."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry import checksums
from spheretwin.models.telemetry.status import Status
from spheretwin.twin.metrics.registry import METRICS
from spheretwin.twin.study.row import FAILED

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet

Array = NDArray[np.float64]
Texts = NDArray[np.object_]

MAIN = "max_abs_error_rad"

TEXTS = ("key", "law", "status", "reason", "error")
BESIDE = ("row", "key", "seed", "law", "repeat", "status", "reason", "error")


class Rows(NamedTuple):
    """All rows of a table.

    Attributes
    ----------
    study : dict
        As its TOML says it.
    numbers : (n,) array
        Of the rows, in the study.
    keys, laws, statuses, complaints : (n,) object arrays
        A complaint is the reason of an end, or the error; empty where there is none.
    axes : mapping of field to (n,) array
        Numbers, or text.
    figures : mapping of name to (n,) array
        Of a figure of each hinge, the largest of the three; NaN where there is none.
    """

    study: dict[str, Any]
    numbers: NDArray[np.int64]
    keys: Texts
    laws: Texts
    statuses: Texts
    complaints: Texts
    axes: Mapping[str, NDArray[Any]]
    figures: Mapping[str, Array]

    @property
    def completed(self) -> NDArray[np.bool_]:
        """Which rows came to their end."""
        return self.statuses == str(Status.COMPLETED)

    @property
    def failures(self) -> NDArray[np.int64]:
        """Places of rows that a watchdog ended, or in which a law or a metric of the user's raised."""
        failed = np.isin(self.statuses, [FAILED, str(Status.FAILSAFE)])
        return np.flatnonzero(failed | (self.completed & (self.complaints != "")))

    @property
    def law_names(self) -> list[str]:
        """Laws, in the order in which they come first."""
        return list(dict.fromkeys(self.laws.tolist()))

    @property
    def main(self) -> str | None:
        """The figure that others are held against: the largest error, else the first that is kept."""
        return MAIN if MAIN in self.figures else next(iter(self.figures), None)


def read(table: Path) -> Rows:
    """Read the rows of a table.

    Raises
    ------
    InputError
        The table is missing or damaged.
    """
    import pyarrow as pa  # slow to import

    try:
        with checksums.open_parquet(table) as file:
            return _rows(file)
    except (OSError, pa.ArrowException) as error:
        raise checksums.unreadable(table, error, "the table of a study") from None


def _rows(file: pyarrow.parquet.ParquetFile) -> Rows:
    import pyarrow as pa

    schema = file.schema_arrow
    study = json.loads(schema.metadata[b"study"])
    axes = [axis["field"] for axis in study["axis"]]
    figures = [
        field.name
        for field in schema
        if field.name not in (*BESIDE, *axes) and not pa.types.is_string(field.type)
    ]
    found = file.read(columns=[*TEXTS, "row", *axes, *figures], use_threads=False)
    texts = {name: np.array(found[name].to_pylist(), dtype=object) for name in TEXTS}
    return Rows(
        study,
        found["row"].to_numpy(),
        texts["key"],
        np.array([_label(law) for law in texts["law"]], dtype=object),
        texts["status"],
        np.array(
            [error or reason or "" for error, reason in zip(texts["error"], texts["reason"], strict=True)],
            dtype=object,
        ),
        {field: _values(found[field]) for field in axes},
        {name: largest(found[name]) for name in sorted(figures, key=_place)},
    )


def largest(column: pa.ChunkedArray) -> Array:
    """One number a row: of a list, the largest; NaN where there is none, or a part of it."""
    import pyarrow as pa

    if not pa.types.is_list(column.type):
        return column.to_numpy().astype(np.float64)
    lists = column.combine_chunks()
    lengths = np.nan_to_num(lists.value_lengths().to_numpy(zero_copy_only=False)).astype(int)
    numbers = np.full(len(lists), np.nan)
    if np.any(lengths):
        flat = lists.flatten().to_numpy(zero_copy_only=False).astype(np.float64)
        starts = np.cumsum(lengths) - lengths
        numbers[lengths > 0] = np.maximum.reduceat(flat, starts[lengths > 0])
    return numbers


def _label(law: str) -> str:
    """A law as people read it: its name, then its gains."""
    if not law.startswith("{"):
        return law
    told = json.loads(law)
    gains = (f"{name} = {value}" for name, value in told.items() if name != "law")
    return ", ".join([told["law"], *gains])


def _values(column: pa.ChunkedArray) -> NDArray[Any]:
    import pyarrow as pa

    if pa.types.is_string(column.type) or pa.types.is_boolean(column.type):
        texts = [each if isinstance(each, str) else json.dumps(each) for each in column.to_pylist()]
        return np.array(texts, dtype=object)
    return column.to_numpy().astype(np.float64)


def _place(name: str) -> int:
    """Metrics in their own order, the user's behind them."""
    return list(METRICS).index(name) if name in METRICS else len(METRICS)
