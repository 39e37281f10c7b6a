"""A derived quantity: what it is called, how it looks, and how it is computed from rows of telemetry."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette

Array = NDArray[np.float64]


class Rows(NamedTuple):
    """What a quantity is computed from."""

    table: Table
    """Rows of one chunk."""
    before: Table
    """The row before the first of them; at the start of a run its first row itself."""
    actuator: Actuator
    current_limit_A: float


class Kept(Enum):
    """What of many rows is drawn: nothing that matters is lost between those that are."""

    BOTH = "both bounds: a line as wide as the values were far apart"
    LEAST = "the least value"
    GREATEST = "the greatest value"
    MEAN = "the mean, where single rows say nothing"


class Quantity(NamedTuple):
    """What is derived from telemetry to be looked at."""

    name: str
    """Ends in its unit."""
    unit: str
    meaning: str
    values: Callable[[Rows], Array]
    """One row for each of the chunk's: (n, size)."""
    floor: float
    """Half of the least range that its plot shows: what is less does not look like something."""
    labels: tuple[str, ...] = ("",)
    """A name for each entry."""
    colours: tuple[palette.Colour, ...] = (palette.PLAIN,)
    """A colour for each entry."""
    needs: str = ""
    """Signal that a run must have for it; none unless given."""
    kept: Kept = Kept.GREATEST

    @property
    def size(self) -> int:
        """Numbers a row."""
        return len(self.labels)


def by_axis(
    name: str,
    unit: str,
    meaning: str,
    values: Callable[[Rows], Array],
    floor: float,
    needs: str = "",
    kept: Kept = Kept.BOTH,
) -> Quantity:
    """Quantity with an entry for each hinge, in the colours of the axes."""
    return Quantity(name, unit, meaning, values, floor, ANGLES, palette.AXIS_COLOURS, needs, kept)
