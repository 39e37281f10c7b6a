"""Environments for reinforcement learning: importing it registers them with Gymnasium.

>>> import gymnasium
>>> import spheretwin.envs
>>> envs = gymnasium.make_vec("spheretwin/Track-v0", num_envs=64)
>>> envs.reset(seed=0)[0].shape[0]
64
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.extras import missing

try:
    import gymnasium
except ModuleNotFoundError:
    raise missing("environments", "gymnasium", "rl") from None

from spheretwin.envs.settings import TASKS

if TYPE_CHECKING:
    from spheretwin.control.policy import OBSERVATION
    from spheretwin.envs.cuda import CudaVectorEnv
    from spheretwin.envs.environment import TwinEnv
    from spheretwin.envs.episode import REWARD_TERMS, STATUS
    from spheretwin.envs.settings import Settings
    from spheretwin.envs.stable_baselines import StableBaselinesEnv
    from spheretwin.envs.vector import TwinVectorEnv

_MODULES = {
    "CudaVectorEnv": "spheretwin.envs.cuda",
    "OBSERVATION": "spheretwin.control.policy",
    "REWARD_TERMS": "spheretwin.envs.episode",
    "STATUS": "spheretwin.envs.episode",
    "Settings": "spheretwin.envs.settings",
    "StableBaselinesEnv": "spheretwin.envs.stable_baselines",
    "TwinEnv": "spheretwin.envs.environment",
    "TwinVectorEnv": "spheretwin.envs.vector",
}

__all__ = [
    "OBSERVATION", "REWARD_TERMS", "STATUS", "CudaVectorEnv", "Settings", "StableBaselinesEnv", "TwinEnv",
    "TwinVectorEnv", "vector_environment",
]  # fmt: skip

DEVICES = {"cpu": "TwinVectorEnv", "cuda": "CudaVectorEnv"}


def vector_environment(num_envs: int = 1, device: str = "cpu", **settings: Any) -> Any:
    """Return a vector environment for ``gymnasium.make_vec``.

    Parameters
    ----------
    num_envs : int
    device : str
        ``cpu``: `TwinVectorEnv`, or ``cuda``: `CudaVectorEnv`.
    **settings
        Other arguments of the class.

    Raises
    ------
    InputError
        As the class, or another device.
    """
    if device not in DEVICES:
        raise InputError(f"environment: expected device {' or '.join(DEVICES)}, received {shown(device)}")
    return __getattr__(DEVICES[device])(num_envs, **settings)


for _task in TASKS:
    gymnasium.register(
        id=f"spheretwin/{_task}-v0",
        entry_point="spheretwin.envs.environment:TwinEnv",
        vector_entry_point="spheretwin.envs:vector_environment",
        kwargs={"task": _task},
    )


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value
