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

_NAMES = {
    "excitation": ("Design", "DesignSettings", "design"),
    "files": ("read", "write"),
    "identification": ("Identified", "IdentifySettings", "identify"),
    "link.machine_link": ("Link",),
    "log": ("Log",),
    "model": ("Model", "model_of"),
    "noise_fit": ("NoiseFit", "fit_noise"),
    "state_estimation": ("Shadow", "ShadowSettings", "Shadowed", "shadow"),
    "validation": ("Validation", "validate"),
    "verdict": ("check",),
    "watching": ("Alarm", "Watch", "WatchSettings"),
}
_MODULES = {name: f"{__name__}.{module}" for module, names in _NAMES.items() for name in names}

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
