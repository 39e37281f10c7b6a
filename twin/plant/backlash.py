"""Backlash of the three hinges: play between the rotor and the shafts whose angles are measured.

The bearings carry the rotor itself: friction, coils, payload, cable and end stops act on it whatever the
play. The measured shaft of a hinge is coupled to the rotor with play. It has no mass, and friction of its
own, small against that of the bearings, holds it: it stays while the rotor turns within the play, and moves
with the rotor at the ends of the play (play operator). Under control this gives lag and limit cycles.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.plant.plant_part import PlantPart, PlantSetup


class Backlash(Record):
    """Play of the hinges."""

    on: bool = field("whether any hinge has play")
    half_rad: Array = field("half of the play", "rad", 3)


@inlined
def _move_joint(backlash: Backlash, plant: Any, substep: int) -> None:
    """Move the measured shafts with the rotor."""
    for i in range(3):
        q, half = plant.rotor.q[i], backlash.half_rad[i]
        plant.joint_q[i] = min(max(plant.joint_q[i], q - half), q + half)


def _fill(rows: Rows, setup: PlantSetup) -> None:
    half_rad = 0.5 * np.asarray(setup.scenario.plant.backlash_rad)
    put(rows, on=np.any(half_rad > 0, axis=-1, keepdims=True), half_rad=half_rad)


BACKLASH = PlantPart(Backlash, _fill, after=_move_joint)
