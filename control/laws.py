"""The shipped laws by name."""

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.adaptive_fuzzy import adaptive_fuzzy
from spheretwin.control.afsm import afsm
from spheretwin.control.gains import Gains
from spheretwin.control.law import Law
from spheretwin.control.pd import pd

LAWS = {"pd": pd, "adaptive_fuzzy": adaptive_fuzzy, "afsm": afsm}


def build(gains: Gains, inertia: NDArray[np.float64], period: float) -> Law:
    """Law that `gains` names, for nominal principal inertias (kg·m²) and a control period (s)."""
    return LAWS[gains.law](gains, inertia, period)
