"""Copies in compiled code."""

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free


@allocation_free
def copy_into(target: NDArray[np.float64], first: int, values: NDArray[np.float64], count: int) -> None:
    """Copy leading values into a vector; a slice would be checked for overlap, at twice the time."""
    for i in range(count):
        target[first + i] = values[i]


@allocation_free
def copy_rows(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """Copy a matrix of three columns."""
    for i in range(source.shape[0]):
        for j in range(3):
            target[i, j] = source[i, j]
