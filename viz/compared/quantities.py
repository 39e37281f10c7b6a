"""What is drawn of every run over time: each quantity a number a tick, in a unit that reads well."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.quantities.delivered import on_the_hinges
from spheretwin.viz.quantities.error_angle import angle_between

Array = NDArray[np.float64]


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
    of: Callable[[Table], Array]
    """Its values, (n,)."""
    desired: Callable[[Table], Array] | None = None
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


def _entry(signal: str, axis: int, factor: float = 1.0) -> Callable[[Table], Array]:
    return lambda table: factor * table[signal][:, axis]


def _largest(signal: str) -> Callable[[Table], Array]:
    return lambda table: np.abs(table[signal]).max(axis=1)


def _whole_error_deg(table: Table) -> Array:
    return np.degrees(angle_between(table["q_rad"], table["q_ref_rad"]))


def _asked_Nm(table: Table) -> Array:
    return np.linalg.norm(table["torque_command_Nm"], axis=1)


def _delivered_Nm(table: Table) -> Array:
    return np.linalg.norm(on_the_hinges(table["q_rad"], table["torque_Nm"]), axis=1)


QUANTITIES = (
    Quantity("whole_error_deg", "error |e| as one angle", "degrees", "whole", ("q_rad", "q_ref_rad"),
             _whole_error_deg),
    *(Quantity(f"error_{axis}_mrad", f"error of {axis}", "mrad", "error", ("error_rad",),
               _entry("error_rad", i, 1e3)) for i, axis in enumerate(ANGLES)),
    *(Quantity(f"angle_{axis}_rad", f"angle {axis}", "rad", "angle", ("q_rad", "q_ref_rad"),
               _entry("q_rad", i), _entry("q_ref_rad", i)) for i, axis in enumerate(ANGLES)),
    *(Quantity(f"sliding_{axis}_rad_s", f"sliding of {axis}", "rad/s", "sliding", ("sliding_s",),
               _entry("sliding_s", i)) for i, axis in enumerate(ANGLES)),
    Quantity("torque_asked_Nm", "torque asked", "N·m", "effort", ("torque_command_Nm",), _asked_Nm),
    Quantity("largest_current_A", "top current", "A", "effort", ("current_A",), _largest("current_A")),
    Quantity("torque_share_1", "torque share", "1", "effort", ("allocation_scale",),
             lambda table: table["allocation_scale"], limits=(0, 1.05)),
    Quantity("torque_delivered_Nm", "torque delivered on the hinges", "N·m", "more",
             ("q_rad", "torque_Nm"), _delivered_Nm),
)  # fmt: skip
"""All, in the order in which they are drawn; a group of them beside each other."""
