"""Data sheet of the electronics: nominal values of a controller that knows its hardware."""

from __future__ import annotations

from typing import Any

from spheretwin.electronics.drive_chain import DriveSection, ResolvedDrive
from spheretwin.electronics.sensor_chain import SensorsSection, accuracy


def drive_sheet(drive: ResolvedDrive) -> dict[str, Any]:
    """Return the nominal values of amplifiers and coils, by field of `nominal`."""
    return {
        "current_limit_A": drive.current_limit_A,
        "delay_s": drive.delay_s,
        "time_constant_s": drive.lag_s,
        "resistance_ohm": drive.resistance_ohm,
        "inductance_H": drive.inductance_H,
        "swing_V": _swing_V(drive),
        "offset_error_A": drive.transconductance_A_V * _offset_V(drive),
        "gain_error": drive.dac_gain_error if drive.dac_bits else 0.0,
    }


def sensor_sheet(sensors: SensorsSection) -> dict[str, Any]:
    """Return the nominal values of the sensors, by field of `nominal`."""
    noise_rad, resolution_rad = accuracy(sensors)
    return {
        "angle_noise_rad": noise_rad,
        "angle_resolution_rad": resolution_rad,
        "current_noise_A": sensors.current.noise_A,
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
