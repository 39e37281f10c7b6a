"""The prototype's sensors as fields of a scenario; README.md beside this says where each value is from."""

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
}
"""Values by dotted name."""
