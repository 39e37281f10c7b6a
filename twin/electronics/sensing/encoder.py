"""The encoder of γ: from an angle that may turn for ever to whole counts of it."""

from __future__ import annotations

from math import pi
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.models.base.compiled import allocation_free
from spheretwin.twin.electronics.fault_line import FaultLine, fault_line, through
from spheretwin.twin.electronics.sensing.stage import Numbers, SensorSetup, SensorStage


class EncoderSection(SensorStage):
    """Incremental encoder of γ; ideal while it has no counts.

    Its counter is set from the pose at the start, rounded to the grid of the disc, and no count is ever lost:
    what it holds is then the angle to the nearest line of the grid, over any number of turns. The index, once
    a turn where γ is a multiple of 2π, lies on that grid. It would find lost counts, and where in a turn a
    rotor of unknown pose stands, neither of which happens here; it could not tell how many turns were missed.
    """

    counts: Annotated[int, Field(ge=0, le=2**31)] = Field(
        0,
        description="counts a turn, rounded to the nearest; 0 for none"
        " (assumed: OME-500-2MCA read as 500 pulses × 4 = 2000, 0.18°)",
    )

    @property
    def ideal(self) -> bool:
        """True if the angle comes out as it goes in."""
        return self.counts == 0

    def build(self, setup: SensorSetup) -> Encoder:
        """Encoder without errors of its own: a line is where it should be."""
        return Encoder(not self.ideal or setup.faults, float(self.counts), fault_line(1))

    @classmethod
    def function(cls) -> Any:
        """Compiled function that counts γ."""
        return pass_encoder


class Encoder(NamedTuple):
    """The encoder, for compiled code."""

    on: bool
    counts_per_turn: float  # 0 for none
    line: FaultLine  # of the angle, rad, before it is counted


@allocation_free
def pass_encoder(encoder: Encoder, measurement: NDArray[np.float64], numbers: Numbers) -> None:
    """Count γ, rad, behind its fault line."""
    turned = through(encoder.line, 0, measurement[0, 2], numbers.faults)
    measurement[0, 2] = counted(encoder, turned)


@allocation_free
def counted(encoder: Encoder, angle_rad: float) -> float:
    """Angle (rad) of the count nearest to an angle (rad), half-way to the even one.

    What is no number stays none, and an angle of more counts than a number can hold is infinite.
    """
    if encoder.counts_per_turn == 0:
        return angle_rad
    count = np.rint(angle_rad * (encoder.counts_per_turn / (2 * pi)))
    return count * (2 * pi / encoder.counts_per_turn)
