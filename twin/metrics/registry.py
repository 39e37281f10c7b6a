"""The metrics of every run by the name that its JSON has them under, which ends in their unit."""

from spheretwin.twin.metrics.effort.copper_loss import CopperLoss
from spheretwin.twin.metrics.effort.current_variation import CurrentVariation
from spheretwin.twin.metrics.effort.max_abs_current import MaxAbsCurrent
from spheretwin.twin.metrics.effort.rms_torque import RmsTorque
from spheretwin.twin.metrics.effort.saturated_fraction import SaturatedFraction
from spheretwin.twin.metrics.metric import Metric
from spheretwin.twin.metrics.tracking.max_abs_error import MaxAbsError
from spheretwin.twin.metrics.tracking.overshoot import Overshoot
from spheretwin.twin.metrics.tracking.rms_error import RmsError
from spheretwin.twin.metrics.tracking.settling_time import SettlingTime
from spheretwin.twin.metrics.tracking.tail_rms_error import TailRmsError

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
