"""Places of points of the rotor in the frame of the stator."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator


def shaft_tip(q: NDArray[np.float64], actuator: Actuator) -> NDArray[np.float64]:
    """Position of the shaft's tip, wherever in the rotor it is: (n, 3) in m, for hinge angles (n, 3)."""
    return point_in_stator(q, actuator.shaft_tip_m)


def point_in_stator(q: NDArray[np.float64], point_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Position in the stator frame of a point of the rotor: (n, 3) in m, for hinge angles (n, 3)."""
    (ca, cb, cg), (sa, sb, sg) = np.cos(q).T, np.sin(q).T
    x, y, z = point_m
    x, y = cg * x - sg * y, sg * x + cg * y  # about z, then y, then x
    x, z = cb * x + sb * z, cb * z - sb * x
    y, z = ca * y - sa * z, sa * y + ca * z
    return np.stack([x, y, z], axis=1)
