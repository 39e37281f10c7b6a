"""What stands around any law, shipped or its user's, each part off unless asked for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.applied_torque import AppliedTorque
from spheretwin.control.compensators import reference_governor
from spheretwin.control.compensators.feed_forward import (
    FeedForward,
    compute_feed_forward,
    subtract_feed_forward,
)
from spheretwin.control.compensators.prediction import Prediction, advance, predict
from spheretwin.control.compensators.reference_governor import Governor, govern
from spheretwin.models.base.compiled import allocation_free, transfer_state
from spheretwin.models.magnetics import TorqueModel

Array = NDArray[np.float64]


class Compensators(NamedTuple):
    """What a control tick does before and after it calls the law."""

    on: bool
    """Whether there is any of it."""
    governor: Governor
    prediction: Prediction
    feed_forward: FeedForward


@allocation_free
def apply_compensators(
    compensators: Compensators,
    applied_torque: AppliedTorque,
    magnetics: TorqueModel,
    measurement: Array,
    reference: Array,
) -> bool:
    """Make of measurement and reference what the law is to be handed.

    Parameters
    ----------
    around : Around
        Changed in place.
    belief : Belief
        Of the currents, at the time of the measurement.
    magnetics : TorqueModel
        Nominal.
    measurement, reference : (3, 3) arrays
        The result too; of the measurement (6, 3) where the delay is predicted over.

    Returns
    -------
    bool
        Whether these are numbers.
    """
    if compensators.governor.on and not govern(compensators.governor, measurement, reference):
        return False
    if compensators.prediction.on:
        if not predict(compensators.prediction, applied_torque, magnetics, measurement):
            return False
        advance(compensators.prediction, reference)
    if compensators.feed_forward.on:
        subtract_feed_forward(compensators.feed_forward, measurement[2])
        compute_feed_forward(compensators.feed_forward, reference)
    return True


def transfer_compensators(before: Compensators, after: Compensators) -> None:
    """Go on with what each part is in the midst of, under other figures."""
    reference_governor.carried_on(before.governor, after.governor)
    transfer_state(before.prediction, after.prediction)
    transfer_state(before.feed_forward, after.feed_forward)
