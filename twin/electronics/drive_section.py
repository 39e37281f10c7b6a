"""Parameters of the drive, and their nominal values for a controller that knows its hardware."""

from __future__ import annotations

from typing import Annotated, Any, cast

from pydantic import Field, model_validator

from spheretwin.control.law import Positive
from spheretwin.electronics.amplifier import AmplifierSection
from spheretwin.electronics.coil import CoilSection
from spheretwin.electronics.converters import DacSection
from spheretwin.electronics.delay import DelaySection
from spheretwin.electronics.stages import DriveStage
from spheretwin.models.coil_group import PerGroup

TimeConstant = Annotated[float, Field(ge=0, le=1e3)]


class DriveSection(DelaySection, DacSection, AmplifierSection, CoilSection):
    """Parameters of the drive; each stage is ideal by default, and the coils are those of the model.

    The bases that are a `DriveStage` are the list of the stages, in the order in which commands pass them.
    """

    time_constant_s: TimeConstant | tuple[TimeConstant, ...] | None = Field(
        None,
        description="current lag L/R of amplifiers without a supply, one number or one for each group, s; 0"
        " for none",
    )
    current_limit_A: Positive | None = Field(None, description="largest group current of the amplifiers, A")

    @model_validator(mode="after")
    def _supply_fits(self) -> DriveSection:
        if self.supply_V is not None and self.time_constant_s is not None:
            raise ValueError(
                "expected either a supply_V, whose amplifiers have a bandwidth, or a time_constant_s,"
                f" received {self.supply_V!r} V and {self.time_constant_s!r} s"
            )
        if self.coil_coupling and self.supply_V is None:
            raise ValueError(
                f"expected a supply_V with a coil_coupling of {self.coil_coupling!r}, received none"
            )
        return self

    @property
    def lag_s(self) -> PerGroup:
        """Time constant of the currents while no voltage is at its limit, s; given if there is no supply."""
        return cast("PerGroup", self.time_constant_s) if self.supply_V is None else 1 / self.bandwidth_rad_s

    @property
    def converts(self) -> bool:
        """True if the setpoint of the amplifiers can differ from the command."""
        return self.delay_s > 0 or not all(kind.ideal(self) for kind in STAGES.values())

    @property
    def swing_V(self) -> float:
        """Largest voltage in the worse direction; 0 for amplifiers without a supply and limit."""
        return 0.0 if self.supply_V is None else self.supply_V - max(self.drop_up_V, self.drop_down_V)

    @property
    def offset_error_A(self) -> float:
        """Largest offset of a current: of amplifier, converter and rounding."""
        offset_V = self.amplifier_offset_V
        if self.dac_bits:
            lsb_V = 2 * self.dac_range_V / 2**self.dac_bits
            offset_V += self.dac_offset_V + (self.dac_inl_lsb + 0.5) * lsb_V
        return self.transconductance_A_V * offset_V

    @property
    def gain_error(self) -> float:
        """Largest relative gain error of a current."""
        return self.dac_gain_error if self.dac_bits else 0.0


STAGES: dict[str, type[DriveStage]] = {
    kind.stage: kind for kind in DriveSection.__bases__ if issubclass(kind, DriveStage)
}
"""Classes of the drive stages by their names, in the order in which the commands pass them."""


class ResolvedDrive(DriveSection):
    """Drive of a run: coils and limit are given, and the lag if there is no supply."""

    resistance_ohm: PerGroup
    inductance_H: PerGroup
    resistance_per_K: PerGroup
    heat_capacity_J_K: PerGroup
    thermal_resistance_K_W: PerGroup
    current_limit_A: Positive


def drive_sheet(drive: ResolvedDrive) -> dict[str, Any]:
    """Return the nominal values of amplifiers and coils, by field of `nominal`."""
    return {
        "current_limit_A": drive.current_limit_A,
        "resistance_ohm": drive.resistance_ohm,
        "inductance_H": drive.inductance_H,
        **amplifier_sheet(drive),
    }


def amplifier_sheet(drive: DriveSection) -> dict[str, Any]:
    """Return the nominal values of the amplifiers alone, by field of `nominal`."""
    return {
        "delay_s": drive.delay_s,
        "time_constant_s": drive.lag_s,
        "swing_V": drive.swing_V,
        "offset_error_A": drive.offset_error_A,
        "gain_error": drive.gain_error,
    }
