"""Cells of tables: formats of a study file, filled in with the columns and the results of a case.

A format is that of Python, as ``{label}`` or ``{L:g}``. Behind the form of a number follow its unit, from the
SI unit of the value, and what is taken of the numbers of all runs: ``{rms_error[0]:.2f mrad}`` is the median
with the range if they differ, ``median`` or ``max`` one of them, and ``q0.95`` a quantile with its
interval. A list has its entries with strokes between them. A value that is absent, and a number that is not
finite, is a dash.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from string import Formatter
from typing import Any, TypeVar

import numpy as np

from spheretwin.paper.experiment import Array, RunOutcome
from spheretwin.study.statistics import quantile_text
from spheretwin.viz.pages.markdown import ResultTable

NONE = "–"
"""Cell without a value."""

SCALES = {"mrad": 1e3, "ms": 1e3, "%": 100.0, "deg": float(np.degrees(1.0))}
"""Numbers of a unit in the SI unit."""

T = TypeVar("T")

ERRORS: dict[str, Callable[[RunOutcome], Any]] = {
    "max_abs_error": lambda outcome: outcome.max_abs_error,
    "measured_max_abs_error": lambda outcome: outcome.measured_max_abs_error,
    "rms_error": lambda outcome: outcome.rms_error,
    "tail_rms_error": lambda outcome: outcome.tail_rms_error,
}
"""Errors of each hinge; the JSON has their median, its interval, and lowest and highest, over the seeds."""


class Numbers:
    """Number of each run of a case."""

    def __init__(self, values: Iterable[float]) -> None:
        self.values = np.array(list(values), np.float64)

    def __format__(self, spec: str) -> str:
        form, scale, taken = _parts(spec)
        values = scale * self.values
        if taken.startswith("q"):
            return quantile_text(values, lambda value: format(value, form), float(taken[1:]))
        if not len(values) or (not taken and not np.all(np.isfinite(values))):
            return NONE
        low, middle, high = (format(value, form) for value in np.quantile(values, [0, 0.5, 1]))
        if not taken:
            return middle if low == high else f"{middle} ({low} to {high})"
        one = float(np.max(values) if taken == "max" else np.median(values))
        return format(one, form) if np.isfinite(one) else NONE


def hinges(by_run: Iterable[Sequence[float]]) -> tuple[Numbers, ...]:
    """Numbers of α, β and γ from those of each run."""
    return tuple(map(Numbers, zip(*by_run, strict=True)))


class _CellFormatter(Formatter):
    def get_field(self, field_name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> tuple[Any, str]:
        try:
            value, first = super().get_field(field_name, args, kwargs)
        except AttributeError:  # of a value that is absent
            value, first = None, field_name
        return value, str(first)

    def get_value(self, key: int | str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        item = args[0]
        if key in kwargs:
            return kwargs[str(key)](item)
        return item[key] if isinstance(key, int) or hasattr(item, "case") else getattr(item, key)

    def format_field(self, value: Any, format_spec: str) -> str:
        if value is None:
            return NONE
        if isinstance(value, list | tuple):
            return " / ".join(self.format_field(entry, format_spec) for entry in value)
        if isinstance(value, str):
            return value
        if isinstance(value, float):
            form, scale, _ = _parts(format_spec)
            unit = " %" * format_spec.endswith("%")
            return f"{scale * value:{form}}{unit}" if np.isfinite(value) else NONE
        return format(value, format_spec)


_FORMATTER = _CellFormatter()


def _parts(spec: str) -> tuple[str, float, str]:
    """Form of a number, its scale, and what is taken of several."""
    form, *more = spec.split(" ")
    taken = [word for word in more if word not in SCALES]
    scale = next((SCALES[word] for word in more if word in SCALES), 1.0)
    return form, scale, taken[0] if taken else ""


Cell = str | Callable[[T], str]
"""Format, or function of an item."""


def table(
    title: str,
    items: Iterable[T],
    cells: Mapping[str, Cell[T]],
    texts: int = 1,
    **measures: Callable[[T], Any],
) -> ResultTable:
    """Table with a row for each item, each cell a format or a function of it, by the head of its column.

    A name in a format is that of a measure, which is a function of the item, or of an entry of the item.
    """

    def text(cell: Cell[T], item: T) -> str:
        return _FORMATTER.vformat(cell, [item], measures) if isinstance(cell, str) else cell(item)

    rows = [tuple(text(cell, item) for cell in cells.values()) for item in items]
    return ResultTable(title, tuple(cells), rows, texts)


def of_axis(outcomes: Sequence[RunOutcome], error: str, axis: int) -> Array:
    """One of `ERRORS` of one hinge for each seed, rad."""
    return np.array([ERRORS[error](outcome)[axis] for outcome in outcomes])


def figures_named(outcomes: Sequence[RunOutcome], metric: str) -> Array:
    """One metric of each seed; NaN if a run has none."""
    return np.array([outcome.figures.get(metric) for outcome in outcomes], dtype=np.float64)


def statuses_text(outcomes: Sequence[RunOutcome]) -> str:
    """Statuses of the runs of a case."""
    counts = Counter(outcome.status for outcome in outcomes)
    if len(counts) == 1:
        return str(next(iter(counts)))
    return ", ".join(f"{count} {status}" for status, count in counts.items())
