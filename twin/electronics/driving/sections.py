"""Sections of amplifiers and coils, stage by stage."""

from __future__ import annotations

from typing import Annotated, cast

from pydantic import Field, model_validator

from spheretwin.control.parts.parameters import Positive
from spheretwin.twin.electronics.driving.amplifier import AmplifierSection
from spheretwin.twin.electronics.driving.coil import CoilSection
from spheretwin.twin.electronics.driving.dac import DacSection
from spheretwin.twin.electronics.driving.delay import DelaySection


class DriveSection(DelaySection, DacSection, AmplifierSection, CoilSection):
    """From commands to currents; each stage is ideal until told otherwise, and the coils are the model's."""

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
        """Whether what is asked of the amplifiers is other than the command."""
        return self.delay_s > 0 or self.dac_bits > 0


class ResolvedDrive(DriveSection):
    """Drive of a run: coils and limit are given, and the lag where there is no supply."""

    resistance_ohm: Positive
    inductance_H: Positive
    current_limit_A: Positive

    @property
    def lag_s(self) -> float:
        """Lag of the currents while no voltage is at its limit."""
        return cast("float", self.time_constant_s) if self.supply_V is None else 1 / self.bandwidth_rad_s
