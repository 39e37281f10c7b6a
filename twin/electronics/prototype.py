"""Electronics of the prototype as fields of a scenario; README.md in this folder states the sources."""

from math import radians
from typing import Any

PROTOTYPE_SENSORS: dict[str, Any] = {
    "sensors.potentiometer.electrical_angle_rad": radians(300),
    "sensors.potentiometer.supply_V": 5.0,
    "sensors.potentiometer.nonlinearity_rad": radians(0.02),
    "sensors.potentiometer.noise_rad": radians(0.02),
    "sensors.adc.bits": 16,
    "sensors.adc.range_V": 2.5,
    "sensors.adc.offset_V": 1e-3,
    "sensors.adc.gain_error": 1e-3,
    "sensors.adc.noise_V": 5 / 2**16,  # 1 LSB
    "sensors.adc.oversampling": 1,
    "sensors.encoder.counts": 2000,
    "sensors.current.noise_A": 0.02,  # assumed: a Hall sensor's
}
"""Values by dotted name."""

PROTOTYPE_DRIVE: dict[str, Any] = {
    "drive.delay_s": 1e-3,  # assumed: one control period
    "drive.dac_bits": 16,  # sheet (AD5370)
    "drive.dac_range_V": 10.0,  # sheet: span 20 V at 5 V; centred on 0, assumed
    "drive.dac_offset_V": 2e-3,  # assumed
    "drive.dac_gain_error": 1e-3,  # assumed
    "drive.dac_inl_lsb": 4.0,  # assumed
    "drive.supply_V": 24.0,  # assumed; sheet (OPA549): 4 to 30
    "drive.drop_up_V": 4.8,  # sheet, worst at 8 A
    "drive.drop_down_V": 4.6,  # sheet, worst at 8 A
    "drive.bandwidth_rad_s": 12566.370614359172,  # assumed: 2 kHz
    "drive.transconductance_A_V": 0.8,  # assumed
    "drive.amplifier_offset_V": 1e-3,  # sheet, typical; 5e-3 at most
    "drive.current_limit_A": 8.0,  # sheet, continuous
    "drive.resistance_ohm": 1.3,  # assumed
    "drive.inductance_H": 0.9e-3,  # assumed
    "drive.resistance_per_K": 0.0039,  # property of copper
    "drive.heat_capacity_J_K": 60.0,  # assumed
    "drive.thermal_resistance_K_W": 4.0,  # assumed
    "drive.ambient_degC": 20.0,  # assumed
    "drive.shutdown_degC": 155.0,  # assumed: insulation of class F
}
"""Values by dotted name."""
