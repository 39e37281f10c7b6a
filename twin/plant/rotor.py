"""What a rotor is to the loop, whichever engine moves it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.mjcf import Mjcf


class RotorSettings(NamedTuple):
    """What a rotor is set up from."""

    model: Mjcf
    actuator: Actuator
    step_s: float
    integrator: str
    modelling_error: float
    """m: the rotor's inertia is (1 + m) times the model's (11), (54)."""
    payload_kg: float
    gravity_m_s2: float | None
    """Along -z; the model's own where it is None."""


class Rotor(Protocol):
    """A rotor that has been set up for one run."""

    def start(self, q: NDArray[np.float64], qdot: NDArray[np.float64]) -> Any:
        """Set pose and rates; return the named tuple that compiled code steps.

        Parameters
        ----------
        q : (3,) array, rad
            Hinge angles.
        qdot : (3,) array, rad/s
            Their rates.

        Returns
        -------
        named tuple
            It has `q`, `qdot` (3,), and takes `torque_q` (3,) on the hinges; `warnings` (n,) are
            counts that end a run when one rises.
        """
        ...

    def state(self) -> NDArray[np.float64]:
        """Everything that the next steps depend on."""
        ...

    def restore(self, state: NDArray[np.float64]) -> None:
        """Go on from a state; what `start` returned stays valid."""
        ...


class EngineKind(NamedTuple):
    """One row of the engines that can move a rotor."""

    name: str
    """As `plant.engine` has it."""
    set_up: Callable[[RotorSettings], Rotor]
    """May refuse, with an InputError, a model that holds what it does not know."""
    data: type
    """Class of what `Rotor.start` returns."""
    step: Callable[[Any], None]
    """Takes one physics step of that; compiled."""
