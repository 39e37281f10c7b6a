"""All that stands around a law in one run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.around import feed_forward, governor, prediction
from spheretwin.control.around.feed_forward import FeedForward
from spheretwin.control.around.governor import Governor
from spheretwin.control.around.prediction import Prediction

Array = NDArray[np.float64]


class Around(NamedTuple):
    """What a control tick does before and after it calls the law."""

    governor: Governor
    prediction: Prediction
    feed: FeedForward


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
