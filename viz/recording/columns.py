"""Arrays in the forms in which Rerun takes many rows at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from spheretwin.viz.layout.paths import CHECKSUM, TIMELINE, TOTAL

Index = list[rr.TimeColumn]

_SCALARS = next(iter(rr.Scalars.columns(scalars=np.zeros(1)))).component_descriptor()


def time_index(t_s: NDArray[np.float64]) -> Index:
    """Times in whole nanoseconds: Rerun would cut the fraction of seconds off, a nanosecond too early."""
    return [rr.TimeColumn(TIMELINE, duration=nanoseconds(t_s).astype("timedelta64[ns]"))]


def nanoseconds(t_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return times as a recording has them."""
    return np.round(t_s * 1e9).astype(np.int64)


def scalars(values: NDArray[np.float64], size: int) -> rr.ComponentColumn:
    """What `rr.Scalars.columns` makes of (n, size) values, at half its price."""
    batch = rr.components.ScalarBatch(values.ravel())
    return rr.ComponentColumn(_SCALARS, batch, offsets=size * np.arange(len(values) + 1, dtype=np.int32))


class Struct:
    """Values with named fields, as a component.

    Rerun's own form for types that it does not know wants each name to have one type in a whole process,
    and runs differ in their signals.
    """

    def __init__(self, fields: Mapping[str, pa.Array]) -> None:
        self._array = pa.StructArray.from_arrays(list(fields.values()), list(fields))

    def as_arrow_array(self) -> pa.Array:
        """What Rerun asks for."""
        return self._array


class Numbers:
    """Whole numbers as a component."""

    def __init__(self, values: Sequence[int] | NDArray[np.uint64]) -> None:
        self._array = pa.array(values, type=pa.uint64())

    def as_arrow_array(self) -> pa.Array:
        """Return what Rerun asks for."""
        return self._array


def checksums(values: NDArray[np.uint64]) -> rr.ComponentColumn:
    """Return the component with number and checksum of each line."""
    return rr.ComponentColumn(CHECKSUM, Numbers(values))


def range_checksum(first: int, count: int, checksum: int) -> rr.ComponentColumn:
    """Return the component with the checksum of some rows, by the number of the first and their count."""
    return rr.ComponentColumn(CHECKSUM, Numbers([first, count, checksum]), lengths=[3])


def total(count: int) -> rr.DescribedComponentBatch:
    """Return the component with the number of rows or lines of a complete recording."""
    return rr.DescribedComponentBatch(Numbers([count]), rr.ComponentDescriptor(TOTAL))


def vectors(values: NDArray[np.float64], size: int) -> pa.Array:
    """Arrow form of (n, size) values: `size` numbers a row, whose places need no room."""
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), size)


def no_vectors(rows: int, size: int) -> pa.Array:
    """What stands for (n, size) values where there are none."""
    return pa.nulls(rows, pa.list_(pa.float64(), size))


def strips(segments: NDArray[np.float64]) -> pa.Array:
    """Arrow form of equally long line strips (n, points, 3); Rerun's own conversion takes them one by one."""
    kind = rr.components.LineStrip3DBatch([]).as_arrow_array().type
    flat = pa.array(segments.ravel().astype(np.float32))
    points = pa.FixedSizeListArray.from_arrays(flat, type=kind.value_type)
    starts = np.arange(len(segments) + 1, dtype=np.int32) * segments.shape[1]
    return pa.ListArray.from_arrays(pa.array(starts), points, type=kind)
