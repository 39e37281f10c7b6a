"""Metrics of a run: compiled reducers of its rows, by the names of their figures."""

from spheretwin.metrics.effort import (
    CopperLoss,
    CurrentVariation,
    LearnedRange,
    MaxAbsCurrent,
    RmsTorque,
    RotorTemperature,
    SaturatedFraction,
)
from spheretwin.metrics.reduction import Metric
from spheretwin.metrics.tracking import MaxAbsError, Overshoot, RmsError, SettlingTime, TailRmsError

METRICS: dict[str, type[Metric]] = {
    "max_abs_error_rad": MaxAbsError,
    "rms_error_rad": RmsError,
    "tail_rms_error_rad": TailRmsError,
    "settling_time_s": SettlingTime,
    "overshoot_rad": Overshoot,
    "max_abs_current_A": MaxAbsCurrent,
    "saturated_fraction": SaturatedFraction,
    "rms_torque_Nm": RmsTorque,
    "current_variation_A_s": CurrentVariation,
    "copper_loss_J": CopperLoss,
}

CHECKS: tuple[type[Metric], ...] = (RotorTemperature, LearnedRange)
"""Quantities that give warnings and no figures."""
