"""Digital twin of a permanent-magnet spherical actuator: simulate, control, record, review, compare.

>>> import spheretwin as st
>>> run = st.simulate("nutation", {"controller.law": "afsm"})
>>> print(run.status)
completed
>>> path = run.save("nutation.rrd")
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spheretwin.analysis.recorded_run import open_run as read
    from spheretwin.analysis.review import review
    from spheretwin.bench import Bench
    from spheretwin.control.law import Law, NonNegativeEach, PositiveEach
    from spheretwin.control.law_components.parameters import LawParameters
    from spheretwin.control.policy import PolicyLaw
    from spheretwin.linear import linearise
    from spheretwin.models.lagrangian import coriolis_matrix, inertia_matrix
    from spheretwin.models.telemetry.signals import Signal
    from spheretwin.run import Run
    from spheretwin.scenario import load
    from spheretwin.scenario.sections import Scenario
    from spheretwin.session import Session
    from spheretwin.simulation import simulate
    from spheretwin.study.runner import run as sweep
    from spheretwin.study.sensitivities import sensitivities

# Numba, MuJoCo and the rest are imported with the first name that needs them.
_MODULES = {
    "simulate": ("spheretwin.simulation", "simulate"),
    "Session": ("spheretwin.session", "Session"),
    "load": ("spheretwin.scenario", "load"),
    "Scenario": ("spheretwin.scenario.sections", "Scenario"),
    "Law": ("spheretwin.control.law", "Law"),
    "LawParameters": ("spheretwin.control.law_components.parameters", "LawParameters"),
    "NonNegativeEach": ("spheretwin.control.law", "NonNegativeEach"),
    "PolicyLaw": ("spheretwin.control.policy", "PolicyLaw"),
    "PositiveEach": ("spheretwin.control.law", "PositiveEach"),
    "Signal": ("spheretwin.models.telemetry.signals", "Signal"),
    "inertia_matrix": ("spheretwin.models.lagrangian", "inertia_matrix"),
    "coriolis_matrix": ("spheretwin.models.lagrangian", "coriolis_matrix"),
    "Run": ("spheretwin.run", "Run"),
    "linearise": ("spheretwin.linear", "linearise"),
    "sweep": ("spheretwin.study.runner", "run"),
    "sensitivities": ("spheretwin.study.sensitivities", "sensitivities"),
    "review": ("spheretwin.analysis.review", "review"),
    "read": ("spheretwin.analysis.recorded_run", "open_run"),
    "Bench": ("spheretwin.bench", "Bench"),
}

__all__ = [
    "Bench", "Law", "LawParameters", "NonNegativeEach", "PolicyLaw", "PositiveEach", "Run",
    "Scenario", "Session", "Signal", "__version__", "coriolis_matrix", "inertia_matrix",
    "linearise", "load", "read", "review", "sensitivities", "simulate", "sweep",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("spheretwin")
    if name not in _MODULES:
        raise AttributeError(f"module 'spheretwin' has no attribute {name!r}; it has {', '.join(__all__)}")
    module, attribute = _MODULES[name]
    value = globals()[name] = getattr(import_module(module), attribute)
    return value


def __dir__() -> list[str]:
    return __all__
