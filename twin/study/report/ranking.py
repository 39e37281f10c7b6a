"""What a figure goes with: rank correlations with each axis, and the order of the axes by them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # Matplotlib is slow to import, and need not be there
    from spheretwin.viz.figures.study_spreads import Rank

NORMAL_95 = 1.96

ENOUGH = 4
"""Rows a column from which on the others can be taken away."""

SINGULAR = 1e6


def ranked(axes: Sequence[NDArray[np.float64]], figure: NDArray[np.float64]) -> Rank:
    """Spearman's rank correlations of a figure, partial where there are rows enough.

    An error does not care for the sign of what shifts it: such an axis has no rank correlation with it, and
    shows by its distance from its middle. Where one axis outweighs all others, these show only when what
    goes with it is taken away: the partial correlation is that of what a linear fit of the ranks of all
    other columns leaves of both.

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
        and bool(np.linalg.cond(inner) < SINGULAR)  # else some axes go together, as those of a zip
    )
    if is_partial:
        inverse = np.linalg.inv(inner)
        size = np.sqrt(np.diag(inverse))
        found = np.zeros(len(columns))
        found[differ[:-1]] = -inverse[-1, :-1] / (size[-1] * size[:-1])
    else:
        found = plain[-1, :-1]
    free = rows - among if is_partial else rows - 1
    from spheretwin.viz.figures.study_spreads import Rank

    return Rank(found[: len(axes)], found[len(axes) :], NORMAL_95 / np.sqrt(free), is_partial)


def strongest(ranks: Iterable[Rank]) -> list[int]:
    """Places of the axes by their largest correlation of either kind, under any law, the strongest first."""
    sizes = [np.maximum(np.abs(rank.by_value), np.abs(rank.by_distance)) for rank in ranks]
    return np.argsort(-np.max(sizes, axis=0), kind="stable").tolist()


def _ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ranks about their mean, of length 1; zeros where nothing differs."""
    from scipy.stats import rankdata  # slow to import

    about = rankdata(values) - (len(values) + 1) / 2
    size = np.sqrt(np.sum(about * about))
    return about / size if size > 0 else about
