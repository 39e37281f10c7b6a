"""Compensators around any law: reference governor, delay prediction, feed-forward; each is off by default."""

from __future__ import annotations

from spheretwin.control.applied_torque import AppliedTorque
from spheretwin.control.compensators.feed_forward import (
    FeedForward,
    compute_feed_forward,
    subtract_feed_forward,
)
from spheretwin.control.compensators.prediction import Prediction, advance, predict
from spheretwin.control.compensators.reference_governor import Governor, govern
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.record import Record, field
from spheretwin.models.magnetics import Arrangement, Tables


class Compensators(Record):
    """Compensators of a run."""

    on: bool = field("whether any compensator is on")
    governor: Governor = field("reference governor")
    prediction: Prediction = field("prediction over the delay")
    feed_forward: FeedForward = field("feed-forward of nominal torques")


@allocation_free
def apply_compensators(
    compensators: Compensators,
    applied_torque: AppliedTorque,
    arrangement: Arrangement,
    tables: Tables,
    measurement: Array,
    reference: Array,
) -> bool:
    """Apply the compensators to the measurement and the reference that the law receives.

    Parameters
    ----------
    compensators : Compensators
        Changed in place.
    applied_torque : AppliedTorque
        Estimate at the time of the measurement.
    arrangement : Arrangement
    tables : Tables
        Of the nominal magnetics.
    measurement, reference : (3, 3) arrays
        Changed in place; the measurement is (6, 3) if the prediction is on.

    Returns
    -------
    bool
        True if both are finite.
    """
    if compensators.governor.on and not govern(compensators.governor, measurement, reference):
        return False
    if compensators.prediction.on:
        if not predict(compensators.prediction, applied_torque, arrangement, tables, measurement):
            return False
        advance(compensators.prediction, reference)
    if compensators.feed_forward.on:
        subtract_feed_forward(compensators.feed_forward, measurement[2])
        compute_feed_forward(compensators.feed_forward, reference)
    return True
