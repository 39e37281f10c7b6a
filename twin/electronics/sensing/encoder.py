"""The encoder of γ: from an angle that may turn for ever to whole counts of it."""

from __future__ import annotations

from math import pi
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from spheretwin.models.base.compiled import allocation_free
from spheretwin.twin.trajectories.trajectory import CONFIG


class EncoderSection(BaseModel):
    """Incremental encoder of γ; ideal while it has no counts.

    Its counter is set from the pose at the start, rounded to the grid of the disc, and no count is ever lost:
    what it holds is then the angle to the nearest line of the grid, over any number of turns. The index, once
    a turn where γ is a multiple of 2π, lies on that grid. It would find lost counts, and where in a turn a
    rotor of unknown pose stands, neither of which happens here; it could not tell how many turns were missed.
    """

    model_config = CONFIG

    counts: Annotated[int, Field(ge=0, le=2**31)] = Field(
        0,
        description="counts a turn, rounded to the nearest; 0 for none"
        " (assumed: OME-500-2MCA read as 500 pulses × 4 = 2000, 0.18°)",
    )

    @property
    def ideal(self) -> bool:
        """Whether the angle comes out as it goes in."""
        return self.counts == 0


class Encoder(NamedTuple):
    """The encoder, for compiled code."""

    counts_per_turn: float  # 0 for none


def encoder(section: EncoderSection) -> Encoder:
    """Encoder without errors of its own: a line is where it should be."""
    return Encoder(float(section.counts))


@allocation_free
def counted(encoder: Encoder, angle_rad: float) -> float:
    """Angle (rad) of the count nearest to an angle (rad), half-way to the even one.

    What is no number stays none, and an angle of more counts than a number can hold is infinite.
    """
    if encoder.counts_per_turn == 0:
        return angle_rad
    count = np.rint(angle_rad * (encoder.counts_per_turn / (2 * pi)))
    return count * (2 * pi / encoder.counts_per_turn)
