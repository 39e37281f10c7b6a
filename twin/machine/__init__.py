"""Real machine: its logs, the shadow that estimates its state, and the identification of its parameters.

>>> import spheretwin as st
>>> from spheretwin import machine
>>> path = st.simulate("tilt", {"hardware": "electronics", "duration": 0.5}).save("run.parquet")
>>> log = machine.read(path)
>>> machine.shadow(log, machine.model_of("tilt", {"hardware": "electronics"})).consistent
True
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spheretwin.machine.excitation import Design, DesignSettings, design
    from spheretwin.machine.files import read, write
    from spheretwin.machine.identification import Identified, IdentifySettings, identify
    from spheretwin.machine.link.machine_link import Link
    from spheretwin.machine.log import Log
    from spheretwin.machine.model import Model, model_of
    from spheretwin.machine.noise_fit import NoiseFit, fit_noise
    from spheretwin.machine.state_estimation import Shadow, Shadowed, ShadowSettings, shadow
    from spheretwin.machine.validation import Validation, validate
    from spheretwin.machine.verdict import check
    from spheretwin.machine.watching import Alarm, Watch, WatchSettings

_MODULES = {
    "Alarm": "spheretwin.machine.watching",
    "Design": "spheretwin.machine.excitation",
    "DesignSettings": "spheretwin.machine.excitation",
    "Identified": "spheretwin.machine.identification",
    "IdentifySettings": "spheretwin.machine.identification",
    "Link": "spheretwin.machine.link.machine_link",
    "Log": "spheretwin.machine.log",
    "Model": "spheretwin.machine.model",
    "NoiseFit": "spheretwin.machine.noise_fit",
    "Shadow": "spheretwin.machine.state_estimation",
    "ShadowSettings": "spheretwin.machine.state_estimation",
    "Shadowed": "spheretwin.machine.state_estimation",
    "Validation": "spheretwin.machine.validation",
    "Watch": "spheretwin.machine.watching",
    "WatchSettings": "spheretwin.machine.watching",
    "check": "spheretwin.machine.verdict",
    "design": "spheretwin.machine.excitation",
    "fit_noise": "spheretwin.machine.noise_fit",
    "identify": "spheretwin.machine.identification",
    "model_of": "spheretwin.machine.model",
    "read": "spheretwin.machine.files",
    "shadow": "spheretwin.machine.state_estimation",
    "validate": "spheretwin.machine.validation",
    "write": "spheretwin.machine.files",
}

__all__ = [
    "Alarm", "Design", "DesignSettings", "Identified", "IdentifySettings", "Link", "Log", "Model", "NoiseFit",
    "Shadow", "ShadowSettings", "Shadowed", "Validation", "Watch", "WatchSettings", "check", "design",
    "fit_noise", "identify", "model_of", "read", "shadow", "validate", "write",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value
