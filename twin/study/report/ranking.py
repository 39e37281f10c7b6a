"""What a figure goes with: rank correlations with each axis, and the order of the axes by them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from spheretwin.viz.figures.study_spreads import Rank

NORMAL_95 = 1.96


def ranked(axes: Sequence[NDArray[np.float64]], figure: NDArray[np.float64]) -> Rank:
    """Spearman's rank correlations of a figure.

    An error does not care for the sign of what shifts it: such an axis has no rank correlation with it, and
    shows by its distance from its middle.

    Parameters
    ----------
    axes : sequence of (n,) arrays
    figure : (n,) array
    """
    by_value = [_correlation(axis, figure) for axis in axes]
    by_distance = [_correlation(np.abs(axis - np.median(axis)), figure) for axis in axes]
    return Rank(np.array(by_value), np.array(by_distance), NORMAL_95 / np.sqrt(len(figure) - 1))


def strongest(ranks: Iterable[Rank]) -> list[int]:
    """Places of the axes by their largest correlation of either kind, under any law, the strongest first."""
    sizes = [np.maximum(np.abs(rank.by_value), np.abs(rank.by_distance)) for rank in ranks]
    return np.argsort(-np.max(sizes, axis=0), kind="stable").tolist()


def _correlation(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Of the ranks; 0 where one of them does not differ."""
    from scipy.stats import rankdata  # slow to import

    a, b = (rankdata(each) - (len(each) + 1) / 2 for each in (x, y))
    size = np.sqrt(np.sum(a * a) * np.sum(b * b))
    return float(np.sum(a * b) / size) if size > 0 else 0.0
