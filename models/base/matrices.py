"""Products of small matrices."""

import numpy as np

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import compiled


@compiled
def product(left: Array, right: Array) -> Array:
    """Return the product of a small matrix and one with many columns.

    A BLAS with several threads is many times slower for these sizes on a busy machine.
    """
    rows, inner, columns = left.shape[0], left.shape[1], right.shape[1]
    result = np.zeros((rows, columns))
    for i in range(rows):
        for k in range(inner):
            factor = left[i, k]
            for j in range(columns):
                result[i, j] += factor * right[k, j]
    return result
