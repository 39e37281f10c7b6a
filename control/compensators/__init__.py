"""What stands around any law, shipped or its user's, each part off unless asked for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.applied_torque import Belief
from spheretwin.control.compensators import reference_governor
from spheretwin.control.compensators.feed_forward import FeedForward, reckon, take_off
from spheretwin.control.compensators.prediction import Prediction, advance, predict
from spheretwin.control.compensators.reference_governor import Governor, govern
from spheretwin.models.base.compiled import allocation_free, transfer_state
from spheretwin.models.magnetics import TorqueModel

Array = NDArray[np.float64]


class Around(NamedTuple):
    """What a control tick does before and after it calls the law."""

    on: bool
    """Whether there is any of it."""
    governor: Governor
    prediction: Prediction
    feed: FeedForward


@allocation_free
def prepare(
    around: Around, belief: Belief, magnetics: TorqueModel, measurement: Array, reference: Array
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
    if around.governor.on and not govern(around.governor, measurement, reference):
        return False
    if around.prediction.on:
        if not predict(around.prediction, belief, magnetics, measurement):
            return False
        advance(around.prediction, reference)
    if around.feed.on:
        take_off(around.feed, measurement[2])
        reckon(around.feed, reference)
    return True


def carried_on(before: Around, after: Around) -> None:
    """Go on with what each part is in the midst of, under other figures."""
    reference_governor.carried_on(before.governor, after.governor)
    transfer_state(before.prediction, after.prediction)
    transfer_state(before.feed, after.feed)
