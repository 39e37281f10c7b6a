"""Plant: public step of one plant and of many, control period of the loop, two rotor engines, friction.

>>> import numpy as np
>>> from spheretwin import plant
>>> parameters = plant.parameters("nutation", {"plant.payload_kg": 0.1})
>>> state = plant.State(np.zeros(3), np.zeros(3))
>>> state = plant.step(state, np.full(18, 0.5), np.zeros(3), parameters, 5e-4)  # A, N·m, s
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spheretwin.plant.plant_step import Parameters, State, step, torque_matrix
    from spheretwin.plant.plants import Plants

_MODULES = {
    "Plants": "spheretwin.plant.plants",
    "Parameters": "spheretwin.plant.plant_step",
    "State": "spheretwin.plant.plant_step",
    "step": "spheretwin.plant.plant_step",
    "torque_matrix": "spheretwin.plant.plant_step",
    "parameters": "spheretwin.config.plant_model",
    "linearise": "spheretwin.linear",
}

__all__ = ["Parameters", "Plants", "State", "linearise", "parameters", "step", "torque_matrix"]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value
