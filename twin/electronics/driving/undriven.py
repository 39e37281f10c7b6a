"""A group that its amplifier does not drive: open, or shorted at its ends.

An open group carries no current from the first moment: what its field holds goes into the arc. A shorted one
obeys ``L di/dt = -R i - e``: its current dies down with L/R, to what the back-EMF drives through it, and
brakes the rotor. With the EMF held over a physics step the step is solved exactly, and R i² heats the coil.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free
from spheretwin.twin.electronics.driving.amplifier import LARGEST_EMF_V, Flow
from spheretwin.twin.electronics.driving.coil import OPEN, Coil
from spheretwin.twin.electronics.driving.relaxation import relaxation

Array = NDArray[np.float64]


@allocation_free
def undriven(
    contact: int, coil: Coil, group: int, step_s: float, emf_V: float, current: Array, mean: Array, flow: Flow
) -> None:
    """Advance the current of one undriven group by a physics step.

    Parameters
    ----------
    contact : int
        `OPEN` or `SHORTED`.
    coil : Coil
        Its temperature is left as it is.
    group : int
    step_s : float, s
    emf_V : float, V
        Back-EMF, held over the step.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Result: over the step.
    flow : Flow
        The copper loss is added to; nothing passes the coil's ends.
    """
    if contact == OPEN:
        current[group] = mean[group] = 0.0
        return
    R, start = coil.resistance_ohm[group], current[group]
    shares = relaxation(step_s * R / coil.inductance_H)
    last = -min(max(emf_V, -LARGEST_EMF_V), LARGEST_EMF_V) / R
    current[group] = start + shares.settled * (last - start)
    mean[group] = start + shares.mean * (last - start)
    square = (
        shares.start_start * (start * start)
        + shares.start_settled * (2.0 * start * last)
        + shares.settled_settled * (last * last)
    )
    flow.copper_J[group] += step_s * R * square
