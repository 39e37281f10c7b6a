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
        "swing_V": _swing_V(drive),
        "offset_error_A": drive.transconductance_A_V * _offset_V(drive),
        "gain_error": drive.dac_gain_error if drive.dac_bits else 0.0,
    }


def _swing_V(drive: DriveSection) -> float:
    """Return the largest voltage in the worse direction; 0 for amplifiers without a supply and limit."""
    return 0.0 if drive.supply_V is None else drive.supply_V - max(drive.drop_up_V, drive.drop_down_V)


def _offset_V(drive: DriveSection) -> float:
    """Return the largest offset at the input of an amplifier: amplifier, converter and rounding."""
    if not drive.dac_bits:
        return drive.amplifier_offset_V
    lsb_V = 2 * drive.dac_range_V / 2**drive.dac_bits
    return drive.amplifier_offset_V + (drive.dac_offset_V + (drive.dac_inl_lsb + 0.5) * lsb_V)
