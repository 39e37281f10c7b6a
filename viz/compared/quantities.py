"""What is drawn of every run over time: each quantity a number a tick, in a unit that reads well."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.quantities.delivered import DELIVERED
from spheretwin.viz.quantities.error import ERROR
from spheretwin.viz.quantities.error_angle import ERROR_ANGLE
from spheretwin.viz.quantities.margin import MARGIN, MOST
from spheretwin.viz.quantities.quantity import Array, Rows


class Quantity(NamedTuple):
    """One that is drawn."""

    name: str
    """What stands for it in a path."""
    title: str
    """Short: beside two others it has the room of a sixth of a screen."""
    unit: str
    group: str
    """Of quantities that are drawn in one row."""
    needs: tuple[str, ...]
    """Signals that it is made of."""
    of: Callable[[Rows], Array]
    """Its values, (n,)."""
    desired: Callable[[Rows], Array] | None = None
    """What was asked for, (n,)."""
    limits: tuple[float, float] | None = None
    """Of its axis; what its values need unless given."""

    @property
    def heading(self) -> str:
        """Title with the unit."""
        return f"{self.title} [{self.unit}]"


def drawn(tables: Sequence[Table]) -> list[Quantity]:
    """Quantities that all of some runs have."""
    names = [{signal.name for signal in table.signals} for table in tables]
    return [each for each in QUANTITIES if all(set(each.needs) <= having for having in names)]


def _entry(signal: str, axis: int) -> Callable[[Rows], Array]:
    return lambda rows: rows.table[signal][:, axis]


def _column(values: Callable[[Rows], Array], place: int = 0) -> Callable[[Rows], Array]:
    """One entry of what is derived for a recording of one run."""
    return lambda rows: values(rows)[:, place]


def _largest(signal: str) -> Callable[[Rows], Array]:
    return lambda rows: np.abs(rows.table[signal]).max(axis=1)


def _asked_Nm(rows: Rows) -> Array:
    return np.linalg.norm(rows.table["torque_command_Nm"], axis=1)


def _delivered_Nm(rows: Rows) -> Array:
    return np.linalg.norm(DELIVERED.values(rows), axis=1)


QUANTITIES = (
    Quantity("error_angle_deg", "error as one angle", "°", "whole", ("q_rad", "q_ref_rad"),
             _column(ERROR_ANGLE.values)),
    *(Quantity(f"error_{axis}_mrad", f"error of {axis}", "mrad", "error", ("error_rad",),
               _column(ERROR.values, i)) for i, axis in enumerate(ANGLES)),
    *(Quantity(f"angle_{axis}_rad", f"angle {axis}", "rad", "angle", ("q_rad", "q_ref_rad"),
               _entry("q_rad", i), _entry("q_ref_rad", i)) for i, axis in enumerate(ANGLES)),
    *(Quantity(f"sliding_{axis}_rad_s", f"sliding of {axis}", "rad/s", "sliding", ("sliding_s",),
               _entry("sliding_s", i)) for i, axis in enumerate(ANGLES)),
    Quantity("torque_asked_Nm", "torque asked", "N·m", "effort", ("torque_command_Nm",), _asked_Nm),
    Quantity("largest_current_A", "top current", "A", "effort", ("current_A",), _largest("current_A")),
    Quantity("torque_margin", "torque margin", "1", "effort", ("current_command_A", "allocation_scale"),
             _column(MARGIN.values), limits=(-0.05 * MOST, 1.05 * MOST)),
    Quantity("torque_delivered_Nm", "torque delivered on the hinges", "N·m", "more",
             ("q_rad", "torque_Nm"), _delivered_Nm),
)  # fmt: skip
"""All, in the order in which they are drawn; a group of them beside each other."""
