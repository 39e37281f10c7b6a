"""The shipped laws by name."""

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.law import Law
from spheretwin.control.laws.adaptive_fuzzy import adaptive_fuzzy
from spheretwin.control.laws.afsm import afsm
from spheretwin.control.laws.pd import pd
from spheretwin.control.parts.gains import Gains

LAWS = {"pd": pd, "adaptive_fuzzy": adaptive_fuzzy, "afsm": afsm}


def build(gains: Gains, inertia: NDArray[np.float64], period: float) -> Law:
    """Law that `gains` names, for nominal principal inertias (kg·m²) and a control period (s)."""
    return LAWS[gains.law](gains, inertia, period)
