"""The shipped laws by name."""

from spheretwin.control.adaptive_fuzzy import adaptive_fuzzy
from spheretwin.control.afsm import afsm
from spheretwin.control.gains import Gains
from spheretwin.control.law import Law
from spheretwin.control.pd import pd
from spheretwin.models.actuator import Actuator

LAWS = {"pd": pd, "adaptive_fuzzy": adaptive_fuzzy, "afsm": afsm}


def build(gains: Gains, actuator: Actuator, period: float) -> Law:
    """Law that `gains` names, for an actuator's nominal inertia and a control period in s."""
    return LAWS[gains.law](gains, actuator, period)
