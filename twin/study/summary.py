"""A study in a few lines: rows by status, median and 95 % range of each figure, law by law."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.metrics.registry import METRICS

LEVELS = (2.5, 50.0, 97.5)


def summary(table: Path) -> dict[str, Any]:
    """What the table of a study says as a whole.

    Parameters
    ----------
    table : Path

    Returns
    -------
    dict
        By law: ``statuses`` with their counts, and for each figure of the completed rows ``median`` and
        ``range_95``; of a figure of each hinge, the largest of the three is taken.
    """
    import pyarrow.parquet as parquet  # slow to import

    names = parquet.read_schema(table).names
    figures = [name for name in METRICS if name in names]
    read = parquet.read_table(table, columns=["law", "status", *figures])
    laws = np.array(read["law"].to_pylist(), dtype=object)
    statuses = np.array(read["status"].to_pylist(), dtype=object)
    values = {name: _numbers(read[name].to_pylist()) for name in figures}
    found: dict[str, Any] = {}
    for law in dict.fromkeys(laws.tolist()):
        of_law = laws == law
        completed = of_law & (statuses == str(Status.COMPLETED))
        found[law] = {
            "statuses": dict(Counter(statuses[of_law].tolist())),
            **{name: _spread(values[name][completed]) for name in figures},
        }
    return json.loads(json.dumps(found))


def _numbers(column: list[Any]) -> NDArray[np.float64]:
    """One number a row, NaN where there is none."""
    return np.array([_largest(value) for value in column], dtype=np.float64)


def _largest(value: Any) -> float:
    if isinstance(value, list):
        return np.nan if None in value else max(value, default=np.nan)
    return np.nan if value is None else value


def _spread(values: NDArray[np.float64]) -> dict[str, Any]:
    """Median and range of the numbers among some values; None where there is none."""
    numbers = values[np.isfinite(values)]
    if not len(numbers):
        return {"median": None, "range_95": None}
    low, median, high = np.percentile(numbers, LEVELS).tolist()
    return {"median": median, "range_95": [low, high]}
