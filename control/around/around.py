"""All that stands around a law in one run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.around import feed_forward, governor, prediction
from spheretwin.control.around.feed_forward import FeedForward, reckon, take_off
from spheretwin.control.around.governor import Governor, govern
from spheretwin.control.around.prediction import Prediction, advance, predict
from spheretwin.control.belief import Belief
from spheretwin.models.base.compiled import allocation_free
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


def state_of(around: Around) -> Array:
    """All that it goes on from."""
    return np.concatenate(
        [
            governor.state_of(around.governor),
            prediction.state_of(around.prediction),
            feed_forward.state_of(around.feed),
        ]
    )


def restore(around: Around, state: Array) -> None:
    """Go on from a state of the same size."""
    first = len(governor.state_of(around.governor))
    second = first + len(prediction.state_of(around.prediction))
    governor.restore(around.governor, state[:first])
    prediction.restore(around.prediction, state[first:second])
    feed_forward.restore(around.feed, state[second:])


def carried_on(before: Around, after: Around) -> None:
    """Go on with what each part is in the midst of, under other figures."""
    governor.carried_on(before.governor, after.governor)
    prediction.restore(after.prediction, prediction.state_of(before.prediction))
    feed_forward.carried_on(before.feed, after.feed)
