"""Sections of amplifiers and coils, stage by stage."""

from __future__ import annotations

from typing import Annotated, cast

from pydantic import Field, model_validator

from spheretwin.control.parts.parameters import Positive
from spheretwin.twin.electronics.driving.amplifier import AmplifierSection
from spheretwin.twin.electronics.driving.coil import CoilSection
from spheretwin.twin.electronics.driving.dac import DacSection
from spheretwin.twin.electronics.driving.delay import DelaySection
from spheretwin.twin.electronics.driving.stage import DriveStage


class DriveSection(DelaySection, DacSection, AmplifierSection, CoilSection):
    """From commands to currents; each stage is ideal until told otherwise, and the coils are the model's.

    Its bases that are a `DriveStage` are the list of the stages, in the order in which commands pass them.
    """

    time_constant_s: Annotated[float, Field(ge=0, le=1e3)] | None = Field(
        None, description="current lag L/R, s; 0 for none; of amplifiers without a supply"
    )
    current_limit_A: Positive | None = Field(None, description="largest group current of the amplifiers, A")

    @model_validator(mode="after")
    def _one_lag(self) -> DriveSection:
        if self.supply_V is not None and self.time_constant_s is not None:
            raise ValueError(
                "expected either a supply_V, whose amplifiers have a bandwidth, or a time_constant_s,"
                f" received {self.supply_V!r} V and {self.time_constant_s!r} s"
            )
        return self

    @property
    def converts(self) -> bool:
        """True if what is asked of the amplifiers is other than the command."""
        return self.delay_s > 0 or not all(kind.ideal(self) for kind in STAGES.values())


STAGES: dict[str, type[DriveStage]] = {
    kind.stage: kind for kind in DriveSection.__bases__ if issubclass(kind, DriveStage)
}
"""Kinds of the stages of the commands by their names, in the order in which the commands pass them."""


class ResolvedDrive(DriveSection):
    """Drive of a run: coils and limit are given, and the lag where there is no supply."""

    resistance_ohm: Positive
    inductance_H: Positive
    current_limit_A: Positive

    @property
    def lag_s(self) -> float:
        """Lag of the currents while no voltage is at its limit."""
        return cast("float", self.time_constant_s) if self.supply_V is None else 1 / self.bandwidth_rad_s
