"""CasADi functions of the plant, and predictive control of its angles with IPOPT (extra ``casadi``).

>>> import numpy as np
>>> from spheretwin import casadi, plant
>>> parameters = plant.parameters("tilt")
>>> f, p = casadi.dynamics(parameters), casadi.parameter_vector(parameters)
>>> f(np.zeros(6), np.full(18, 0.5), p).shape  # rates and accelerations
(6, 1)
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spheretwin.casadi.functions import dynamics, parameter_vector, rigid_body, torque_matrix
    from spheretwin.casadi.nmpc import PredictiveControl

_MODULES = {
    "dynamics": "functions",
    "parameter_vector": "functions",
    "rigid_body": "functions",
    "torque_matrix": "functions",
    "PredictiveControl": "nmpc",
}

__all__ = ["PredictiveControl", "dynamics", "nmpc_file", "parameter_vector", "rigid_body", "torque_matrix"]


def nmpc_file() -> str:
    """Return the reference of predictive control for ``--controller.law``, without casadi."""
    return f"{Path(__file__).with_name('nmpc.py')}:PredictiveControl"


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
    value = globals()[name] = getattr(import_module(f"spheretwin.casadi.{_MODULES[name]}"), name)
    return value
