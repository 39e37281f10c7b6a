"""Statistics of a study: its table as arrays, rank correlations and a summary."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import ceil, floor
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin.metrics import METRICS
from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry import checksums
from spheretwin.models.telemetry.status import Status
from spheretwin.study.row import FAILED
from spheretwin.study.table import FIXED

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet

Texts = NDArray[np.object_]

MAIN, MAIN_mrad, TILT = "max_abs_error_rad", "max_abs_error_mrad", "max_abs_tilt_error_rad"

TEXTS = ("law", "status", "reason", "error")


class StudyTable(NamedTuple):
    """All rows of a table.

    Attributes
    ----------
    study : dict
        As its TOML says it.
    numbers : (n,) array
        Numbers of the rows in the study.
    keys, laws, statuses, complaints : (n,) object arrays
        A complaint is the reason of the status, or the error; empty without one.
    axes : mapping of field to (n,) array
        Numbers, or text.
    figures : mapping of name to (n,) array
        Of a figure of each hinge, the largest of the three; NaN without a value.
    hinges_rad : (n, 3) array, optional
        Largest error of each hinge; None if no row has it.
    """

    study: dict[str, Any]
    numbers: NDArray[np.int64]
    keys: Texts
    laws: Texts
    statuses: Texts
    complaints: Texts
    axes: Mapping[str, NDArray[Any]]
    figures: Mapping[str, Array]
    hinges_rad: Array | None = None

    @property
    def completed(self) -> NDArray[np.bool_]:
        """True for the rows that completed."""
        return self.statuses == str(Status.COMPLETED)

    @property
    def failures(self) -> NDArray[np.int64]:
        """Indices of rows that the watchdog ended, or in which user code raised an exception."""
        failed = np.isin(self.statuses, [FAILED, str(Status.FAILSAFE)])
        return np.flatnonzero(failed | (self.completed & (self.complaints != "")))

    @property
    def law_names(self) -> list[str]:
        """Laws in the order of their first rows."""
        return list(dict.fromkeys(self.laws.tolist()))

    @property
    def main(self) -> str | None:
        """Main figure of the report: the largest error, else the first figure."""
        return next(
            (name for name in (MAIN, MAIN_mrad) if name in self.figures), next(iter(self.figures), None)
        )


def read(table: Path) -> StudyTable:
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


def _rows(file: pyarrow.parquet.ParquetFile) -> StudyTable:
    import pyarrow as pa

    schema = file.schema_arrow
    study = json.loads(schema.metadata[b"study"])
    axes = [axis["field"] for axis in study["axis"]]
    figures = [
        field.name
        for field in schema
        if field.name not in (*FIXED, *axes) and not pa.types.is_string(field.type)
    ]

    def column(name: str) -> pa.ChunkedArray:  # one at a time: a million rows take 8 MB each
        return file.read(columns=[name], use_threads=False).column(0)

    texts = {name: _texts(column(name)) for name in TEXTS}
    # All different: as objects they take four times the memory.
    kept = [np.array(chunk.to_pylist(), dtype=str) for chunk in column("key").chunks]
    keys = np.concatenate(kept) if kept else np.zeros(0, str)
    return StudyTable(
        study,
        column("row").to_numpy(),
        keys,
        np.array([_label(law) for law in texts["law"]], dtype=object),
        texts["status"],
        np.array(
            [error or reason or "" for error, reason in zip(texts["error"], texts["reason"], strict=True)],
            dtype=object,
        ),
        {field: _values(column(field)) for field in axes},
        {name: largest(column(name)) for name in sorted(figures, key=_place)},
        _hinges(column(MAIN)) if MAIN in figures else None,
    )


def _texts(column: pa.ChunkedArray) -> Texts:
    """Texts of a column, equal ones as one object."""
    import pyarrow.compute as compute

    coded = compute.dictionary_encode(column.combine_chunks(), null_encoding="encode")
    return np.array(coded.dictionary.to_pylist(), dtype=object)[coded.indices.to_numpy()]


def largest(column: pa.ChunkedArray) -> Array:
    """One number for each row: the largest of a list; NaN if a number is missing."""
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


def _hinges(column: pa.ChunkedArray) -> Array:
    """Numbers of each hinge, (n, 3); NaN in rows without."""
    lists = column.combine_chunks()
    numbers = np.full((len(lists), 3), np.nan)
    is_complete = np.nan_to_num(lists.value_lengths().to_numpy(zero_copy_only=False)) == 3
    flat = lists.filter(is_complete).flatten().to_numpy(zero_copy_only=False)
    numbers[is_complete] = flat.astype(np.float64).reshape(-1, 3)
    return numbers


def _label(law: str) -> str:
    """Label of a law: its name, then its gains."""
    if not law.startswith("{"):
        return law
    fields = json.loads(law)
    gains = (f"{name} = {value}" for name, value in fields.items() if name != "law")
    return ", ".join([fields["law"], *gains])


def _values(column: pa.ChunkedArray) -> NDArray[Any]:
    import pyarrow as pa

    if pa.types.is_string(column.type) or pa.types.is_boolean(column.type):
        texts = [each if isinstance(each, str) else json.dumps(each) for each in column.to_pylist()]
        return np.array(texts, dtype=object)
    return column.to_numpy().astype(np.float64)


def _place(name: str) -> int:
    """Position of a figure: metrics in their order, then user metrics."""
    return list(METRICS).index(name) if name in METRICS else len(METRICS)


if TYPE_CHECKING:  # Matplotlib is slow to import, and need not be there
    from spheretwin.viz.figures.distributions import Rank

NORMAL_95 = 1.96

ENOUGH = 4
"""Least number of rows for each column of a partial correlation."""

SINGULAR = 1e6


def ranked(axes: Sequence[NDArray[np.float64]], figure: NDArray[np.float64]) -> Rank:
    """Spearman's rank correlations of a figure, partial if there are enough rows.

    An error may depend on the distance of an axis from its middle and not on its sign: both are columns. If
    one axis dominates, the others show in the partial correlation alone: that of the residuals of a linear
    fit of the ranks of all other columns.

    Parameters
    ----------
    axes : sequence of (n,) arrays
    figure : (n,) array
    """
    columns = [*axes, *(np.abs(axis - np.median(axis)) for axis in axes)]
    ranks = np.stack([_ranks(column) for column in (*columns, figure)])
    plain = ranks @ ranks.T
    differ = np.flatnonzero(np.diag(plain) > 0)
    inner = plain[np.ix_(differ, differ)]
    rows, among = len(figure), len(differ)
    is_partial = (
        rows >= ENOUGH * among
        and differ[-1] == len(columns)
        and bool(np.linalg.cond(inner) < SINGULAR)  # else some axes depend on each other, as those of a zip
    )
    if is_partial:
        inverse = np.linalg.inv(inner)
        size = np.sqrt(np.diag(inverse))
        correlations = np.zeros(len(columns))
        correlations[differ[:-1]] = -inverse[-1, :-1] / (size[-1] * size[:-1])
    else:
        correlations = plain[-1, :-1]
    free = rows - among if is_partial else rows - 1
    from spheretwin.viz.figures.distributions import Rank

    return Rank(correlations[: len(axes)], correlations[len(axes) :], NORMAL_95 / np.sqrt(free), is_partial)


def strongest(ranks: Iterable[Rank]) -> list[int]:
    """Indices of the axes by their largest correlation of either kind under any law, the strongest first."""
    sizes = [np.maximum(np.abs(rank.by_value), np.abs(rank.by_distance)) for rank in ranks]
    return np.argsort(-np.max(sizes, axis=0), kind="stable").tolist()


def _ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ranks about their mean, of length 1; zeros if all values are equal."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    about = (np.cumsum(count) - (count - 1) / 2)[place] - (len(values) + 1) / 2
    size = np.sqrt(np.sum(about * about))
    return about / size if size > 0 else about


LEVELS = (2.5, 50.0, 97.5)

TAIL = 0.025
"""Probability beyond each end of an interval of 95 %."""


def interval(values: ArrayLike, share: float = 0.5, draws: int | None = None) -> tuple[float, float]:
    """Return the 95 % interval of a quantile: the bootstrap interval of infinitely many resamples.

    Of a resample, the value of rank r is the one of rank k or below with the probability that a number of the
    distribution Beta(r, n + 1 - r) is at most k/n. So nothing is drawn, and the interval is the same at each
    call. An end is infinite if the draws are too few for it: none may be beyond the quantile.

    Parameters
    ----------
    values : (n,) array
        Infinity is a value; NaN leaves no interval.
    share : float
        Of the quantile; the median unless given.
    draws : int, optional
        Number of independent draws, if several values belong to each.
    """
    from scipy.special import betaincinv  # slow to import

    ordered = np.sort(np.asarray(values, dtype=np.float64))
    count, draws = len(ordered), draws or len(ordered)
    if not count or np.isnan(ordered[-1]):
        return np.nan, np.nan
    rank, low, high = round(share * draws, 9), -np.inf, np.inf
    if (1 - share) ** draws <= TAIL:
        low = ordered[max(ceil(count * betaincinv(ceil(rank), draws + 1 - ceil(rank), TAIL)), 1) - 1]
    if share**draws <= TAIL:
        above = floor(rank) + 1
        high = ordered[ceil(count * betaincinv(above, draws + 1 - above, 1 - TAIL)) - 1]
    return float(low), float(high)


def finite_ends(values: ArrayLike) -> list[float | None]:
    """Interval of the median for JSON: None for an end that the draws do not give."""
    return [end if np.isfinite(end) else None for end in interval(values)]


def quantile_text(
    values: ArrayLike, text: Callable[[float], str], share: float = 0.5, draws: int | None = None
) -> str:
    """Quantile, and its 95 % interval in brackets, a dash for an end for which the draws are too few.

    Parameters
    ----------
    values : (n,) array
        Infinity is a value; a dash is the text of NaN, and of no values.
    text : callable
        Text of a value.
    share, draws
        As of `interval`.
    """
    numbers = np.asarray(values, dtype=np.float64)
    if not len(numbers) or np.any(np.isnan(numbers)):
        return "–"
    median = share == 0.5
    quantile = np.median(numbers) if median else np.quantile(numbers, share, method="inverted_cdf")
    ends = (
        text(end) if np.isfinite(end) or end in numbers else "–" for end in interval(numbers, share, draws)
    )
    return f"{text(float(quantile))} [{', '.join(ends)}]"


def share_interval(cases: float, draws: int) -> tuple[float, float]:
    """Return the 95 % interval of Clopper and Pearson (1934) of a probability that gave some cases."""
    from scipy.special import betaincinv  # slow to import

    low = betaincinv(cases, draws - cases + 1, TAIL) if cases else 0.0
    high = betaincinv(cases + 1, draws - cases, 1 - TAIL) if cases < draws else 1.0
    return float(low), float(high)


def summary(rows: StudyTable) -> dict[str, Any]:
    """Summary of a study.

    Returns
    -------
    dict
        By law: ``statuses`` with their counts, and for each figure of the completed rows ``median``, the
        interval ``median_95`` of this median (None for an end for which the rows are too few), and
        ``range_95`` of the rows; of a figure of each hinge, the largest of the three is taken. The largest
        error of α and β alone is ``max_abs_tilt_error_rad``: a coarse encoder may make γ the largest.
    """
    by_law: dict[str, Any] = {}
    figures = dict(rows.figures)
    if rows.hinges_rad is not None:
        figures = {MAIN: figures.pop(MAIN), TILT: rows.hinges_rad[:, :2].max(axis=1), **figures}
    for law in rows.law_names:
        of_law = rows.laws == law
        by_law[law] = {
            "statuses": dict(Counter(rows.statuses[of_law].tolist())),
            **{name: _spread(values[of_law & rows.completed]) for name, values in figures.items()},
        }
    return by_law


def _spread(values: NDArray[np.float64]) -> dict[str, Any]:
    """Median and range of the finite values; None without one."""
    numbers = values[np.isfinite(values)]
    if not len(numbers):
        return {"median": None, "median_95": None, "range_95": None}
    low, median, high = np.percentile(numbers, LEVELS).tolist()
    return {"median": median, "median_95": finite_ends(numbers), "range_95": [low, high]}
