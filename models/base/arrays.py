"""Types of arrays, and arrays of real numbers from values of a caller, which may be anything."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]


def real_array(values: object) -> Array | None:
    """Return values as an array of real numbers, not copied if they are one; None for any others.

    Texts would be parsed, and complex numbers lose their imaginary part.
    """
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):  # rows of different lengths
        return None
    if array.dtype == np.float64:
        return array
    if array.dtype.kind not in "biuf":
        return None
    with np.errstate(over="ignore"):  # a wider float becomes infinite
        return array.astype(np.float64)


def is_real(value: object) -> bool:
    """True if a value is a single real number."""
    return isinstance(value, int | float | np.integer | np.floating)
