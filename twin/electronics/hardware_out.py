"""The prototype's way out as a scenario has it: which figure is from a sheet, the fields themselves say."""

from typing import Any

PROTOTYPE_DRIVE: dict[str, Any] = {
    "drive.delay_s": 1e-3,
    "drive.dac_bits": 16,
    "drive.dac_range_V": 10.0,
    "drive.dac_offset_V": 2e-3,
    "drive.dac_gain_error": 1e-3,
    "drive.dac_inl_lsb": 4.0,
    "drive.supply_V": 24.0,
    "drive.drop_up_V": 4.8,
    "drive.drop_down_V": 4.6,
    "drive.bandwidth_rad_s": 12566.370614359172,
    "drive.transconductance_A_V": 0.8,
    "drive.amplifier_offset_V": 1e-3,
    "drive.current_limit_A": 8.0,
    "drive.resistance_ohm": 1.3,
    "drive.inductance_H": 0.9e-3,
    "drive.resistance_per_K": 0.0039,
    "drive.heat_capacity_J_K": 60.0,
    "drive.thermal_resistance_K_W": 4.0,
    "drive.ambient_degC": 20.0,
    "drive.shutdown_degC": 155.0,
}
"""Fields of a scenario and their values."""
