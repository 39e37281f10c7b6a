"""Table of a study: a Parquet file with configuration and figures of each run as a row."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spheretwin.metrics import METRICS
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry import checksums
from spheretwin.models.telemetry.status import Status
from spheretwin.scenario import reading
from spheretwin.study.grid import Grid, Row
from spheretwin.study.journal import Journal
from spheretwin.study.row import RowResult, Rows

if TYPE_CHECKING:
    import pyarrow as pa

NAME = "table.parquet"

BATCH_ROWS = 2_000

FIXED = ("row", "key", "seed", "law", "repeat", "status", "reason", "error")
"""Columns of every table in addition to its axes and its figures."""

LARGEST_WHOLE = 2**63 - 1


def check_names(rows: Rows) -> None:
    """Check before the first row that all columns have different names.

    Raises
    ------
    InputError
        Two have the same.
    """
    names = [*FIXED, *(axis.field for axis in rows.study.axis), *rows.metrics, *rows.own_metrics]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(
            f"study {rows.study.name}: expected columns of different names, received {twice[0]} twice"
        )


def write(path: Path, grid: Grid, journal: Journal, rows: Rows) -> int:
    """Write all finished rows in the order of the study, completely or not at all; return how many failed.

    Raises
    ------
    SpheretwinError
        It could not be written; an earlier table is unchanged.
    """
    schema = _schema(grid, journal, rows)
    base = _base(rows)
    metadata = {"study": rows.study.model_dump_json(), "scenario": json.dumps(base)}
    failed = 0

    def records() -> Iterator[dict[str, Any]]:
        nonlocal failed
        for number, (key, *record) in journal.records():
            result = RowResult(*record)
            failed += result.status != Status.COMPLETED or result.error is not None
            yield _record(grid.row(number, key), result, rows, base)

    checksums.write_parquet(
        path, schema.with_metadata(metadata), _batches(schema, records()), compression="zstd"
    )
    return failed


def _batches(schema: pa.Schema, records: Iterator[dict[str, Any]]) -> Iterator[pa.Table]:
    import pyarrow as pa  # slow to import

    while batch := list(islice(records, BATCH_ROWS)):
        yield pa.table(_columns(schema, batch), schema=schema)


def _schema(grid: Grid, journal: Journal, rows: Rows) -> pa.Schema:
    import pyarrow as pa

    own = _own_kinds(journal, rows)
    return pa.schema(
        [
            pa.field("row", pa.int64()),
            pa.field("key", pa.string()),
            pa.field("seed", pa.int64()),
            *(pa.field(axis.field, _kind_of(grid.values(axis.field))) for axis in rows.study.axis),
            pa.field("law", pa.string()),
            pa.field("repeat", pa.int64()),
            *(pa.field(name, pa.string()) for name in ("status", "reason", "error")),
            *(pa.field(name, _figure_kind(name)) for name in rows.metrics),
            *(pa.field(name, own[name]) for name in rows.own_metrics),
        ]
    )


def _kind_of(values: Iterable[Any] | None) -> pa.DataType:
    """Type of a column of some values: their common type, or JSON as text if they have none."""
    import pyarrow as pa

    if values is None:
        return pa.float64()
    tests: list[tuple[Callable[[Any], bool], pa.DataType]] = [
        (_is_truth, pa.bool_()),
        (_is_whole, pa.int64()),
        (_is_number, pa.float64()),
    ]
    listed = [each for each in values if each is not None]
    return next((kind for test, kind in tests if listed and all(map(test, listed))), pa.string())


def _own_kinds(journal: Journal, rows: Rows) -> dict[str, pa.DataType]:
    """Types of user metrics: numbers if all rows have numbers, otherwise JSON as text."""
    import pyarrow as pa

    may_be = dict.fromkeys(rows.own_metrics, True)
    if may_be:
        for _, result in journal.results():
            for name in may_be:
                value = result.figures.get(name)
                may_be[name] &= value is None or _is_number(value)
    return {name: pa.float64() if is_number else pa.string() for name, is_number in may_be.items()}


def _is_truth(value: Any) -> bool:
    return isinstance(value, bool)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= LARGEST_WHOLE


def _is_number(value: Any) -> bool:
    return _is_whole(value) or isinstance(value, float)


def _figure_kind(name: str) -> pa.DataType:
    import pyarrow as pa

    return pa.list_(pa.float64()) if METRICS[name].labels else pa.float64()


def _base(rows: Rows) -> dict[str, Any]:
    """Fields of the base scenario with paths relative to the folder of the study."""
    folder = rows.study.folder or os.curdir
    fields = rows.base.model_dump(mode="json")
    return reading.replace_files(fields, lambda path, _: os.path.relpath(path, folder))


def _record(row: Row, result: RowResult, rows: Rows, base: dict[str, Any]) -> dict[str, Any]:
    law = base["controller"]["law"] if row.law is None else law_text(row.law)
    return {
        "row": row.number,
        "key": row.key,
        "seed": row.seed,
        **row.values,
        "law": law,
        "repeat": row.repeat,
        "status": result.status,
        "reason": result.reason,
        "error": result.error,
        **{name: result.figures.get(name) for name in (*rows.metrics, *rows.own_metrics)},
    }


def law_text(law: Any) -> str:
    """Text of a law: its name, or all fields as JSON if it has others."""
    return str(law["law"]) if set(law) == {"law"} else json.dumps(law, sort_keys=True)


def _columns(schema: pa.Schema, records: list[dict[str, Any]]) -> dict[str, Any]:
    import pyarrow as pa

    return {
        field.name: pa.array(_cells([record[field.name] for record in records], field.type), type=field.type)
        for field in schema
    }


def _cells(values: list[Any], kind: pa.DataType) -> list[Any]:
    """Convert values to the type of a column: JSON as text, whole numbers as floats."""
    import pyarrow as pa

    if pa.types.is_string(kind):
        return [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]
    if pa.types.is_float64(kind):
        return [None if value is None else float(value) for value in values]
    return values
