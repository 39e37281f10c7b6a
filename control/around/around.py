"""All that stands around a law in one run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.around import governor as governors
from spheretwin.control.around.governor import Governor


class Around(NamedTuple):
    """What a control tick does before and after it calls the law."""

    governor: Governor


def state_of(around: Around) -> NDArray[np.float64]:
    """All that it goes on from."""
    return governors.state_of(around.governor)


def restore(around: Around, state: NDArray[np.float64]) -> None:
    """Go on from a state of the same size."""
    governors.restore(around.governor, state)


def carried_on(before: Around, after: Around) -> None:
    """Go on with what each part is in the midst of, under other figures."""
    governors.carried_on(before.governor, after.governor)
