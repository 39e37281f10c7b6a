"""A study in a few lines: rows by status, median and 95 % range of each figure, law by law."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.study.report.reading import Rows

LEVELS = (2.5, 50.0, 97.5)


def summary(rows: Rows) -> dict[str, Any]:
    """What a study says as a whole.

    Returns
    -------
    dict
        By law: ``statuses`` with their counts, and for each figure of the completed rows ``median`` and
        ``range_95``; of a figure of each hinge, the largest of the three is taken.
    """
    found: dict[str, Any] = {}
    for law in rows.law_names:
        of_law = rows.laws == law
        found[law] = {
            "statuses": dict(Counter(rows.statuses[of_law].tolist())),
            **{name: _spread(values[of_law & rows.completed]) for name, values in rows.figures.items()},
        }
    return found


def _spread(values: NDArray[np.float64]) -> dict[str, Any]:
    """Median and range of the numbers among some values; None where there is none."""
    numbers = values[np.isfinite(values)]
    if not len(numbers):
        return {"median": None, "range_95": None}
    low, median, high = np.percentile(numbers, LEVELS).tolist()
    return {"median": median, "range_95": [low, high]}
