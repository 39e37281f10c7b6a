"""The fast plant: the equations of motion, for a model that holds no more than they know."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from spheretwin.models import mjcf
from spheretwin.models.actuator import MJCF_PATH
from spheretwin.models.base.errors import InputError

FAST, FULL = "lagrangian", "mujoco"


def fast_engine(named: str | None, integrator: str) -> str:
    """Fastest plant that a scenario allows.

    Parameters
    ----------
    named : str, optional
        Its model file; the shipped one unless given.
    integrator : str
        Its integrator: the equations of motion have one.
    """
    path = Path(named) if named else MJCF_PATH
    return FAST if integrator == "RK4" and _is_free_rotor(path) else FULL


@lru_cache(maxsize=8)
def _is_free_rotor(path: Path) -> bool:
    """Whether a model holds no more than the Lagrangian knows; one that cannot be read will say so itself."""
    try:
        return not mjcf.read(path).unknown_to_the_lagrangian
    except InputError:
        return False
