"""The table of a study: one Parquet file, a row a run, its configuration and its figures."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import whole_file
from spheretwin.twin.metrics.registry import METRICS
from spheretwin.twin.study.grid import Grid, Row
from spheretwin.twin.study.journal import Journal
from spheretwin.twin.study.row import Result, Rows

if TYPE_CHECKING:
    import pyarrow as pa

NAME = "table.parquet"

BATCH_ROWS = 10_000

FIXED = ("row", "key", "seed", "law", "repeat", "status", "reason", "error")
"""Columns of every table, beside its axes and its figures."""


def write(path: Path, grid: Grid, journal: Journal, rows: Rows) -> None:
    """Write all finished rows, in the order of the study, whole or not at all.

    Raises
    ------
    SpheretwinError
        It could not be written; what was there before is untouched.
    """
    import pyarrow as pa  # slow to import
    import pyarrow.parquet as parquet

    schema = _schema(grid, rows)
    metadata = {"study": rows.study.model_dump_json(), "scenario": rows.base.model_dump_json()}
    with (
        whole_file(path) as temporary,
        parquet.ParquetWriter(temporary, schema.with_metadata(metadata), compression="zstd") as writer,
    ):
        finished = journal.results()
        while batch := list(islice(finished, BATCH_ROWS)):
            columns = _columns(schema, [_record(grid[number], result, rows) for number, result in batch])
            writer.write_table(pa.table(columns, schema=schema))


def _schema(grid: Grid, rows: Rows) -> pa.Schema:
    import pyarrow as pa

    fields = [
        pa.field("row", pa.int64()),
        pa.field("key", pa.string()),
        pa.field("seed", pa.int64()),
        *(pa.field(axis.field, _kind(grid, axis.field)) for axis in rows.study.axis),
        pa.field("law", pa.string()),
        pa.field("repeat", pa.int64()),
        *(pa.field(name, pa.string()) for name in ("status", "reason", "error")),
        *(pa.field(name, _figure_kind(name)) for name in rows.metrics),
        *(pa.field(name, pa.string()) for name in rows.own_metrics),
    ]
    names = [field.name for field in fields]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(
            f"study {rows.study.name}: expected columns of different names, received {twice[0]} twice"
        )
    return pa.schema(fields)


def _kind(grid: Grid, field: str) -> pa.DataType:
    """Numbers where all values of an axis are; text of JSON else."""
    import pyarrow as pa

    return pa.float64() if grid.is_number(field) else pa.string()


def _figure_kind(name: str) -> pa.DataType:
    import pyarrow as pa

    return pa.list_(pa.float64()) if METRICS[name].labels else pa.float64()


def _record(row: Row, result: Result, rows: Rows) -> dict[str, Any]:
    law = rows.base.controller.law if row.law is None else _law_text(row.law)
    own = {name: json.dumps(result.figures.get(name)) for name in rows.own_metrics}
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
        **{name: result.figures.get(name) for name in rows.metrics},
        **own,
    }


def _law_text(law: Any) -> str:
    """Its name alone, where nothing else is said of it."""
    return str(law["law"]) if set(law) == {"law"} else json.dumps(law, sort_keys=True)


def _columns(schema: pa.Schema, records: list[dict[str, Any]]) -> dict[str, Any]:
    import pyarrow as pa

    columns: dict[str, Any] = {}
    for field in schema:
        values: Iterator[Any] = (record[field.name] for record in records)
        if pa.types.is_string(field.type):
            values = (each if each is None or isinstance(each, str) else json.dumps(each) for each in values)
        columns[field.name] = pa.array(list(values), type=field.type)
    return columns
