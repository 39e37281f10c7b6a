"""What a control law is to the loop: one function of fixed signature, its numbers, its state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.models.errors import InputError
from spheretwin.models.telemetry import SIGNALS, Signal, width

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]

SIGNATURE = types.void(types.float64, _matrix, _matrix, _vector, _vector, _vector)
"""Compiled signature: t, reference (3, 3), measurement (2, 3), parameters, state, torque (3,)."""


@dataclass(frozen=True, eq=False)
class Law:
    """A control law, ready for the loop.

    Attributes
    ----------
    name : str
        For tables and figures.
    step : callable
        ``step(t, reference, measurement, parameters, state, torque)`` writes the generalised torque
        (N·m) on (alpha, beta, gamma) into `torque` and returns nothing. `reference` holds the desired
        angle, rate and acceleration as rows (rad, rad/s, rad/s²), `measurement` angle and rate.
        `state` is the law's memory, changed in place. A plain Python function works; one that numba
        compiles runs at the speed of the shipped laws. It must write all three torques at every call:
        one that is left out, or is no number, ends the run as ``diverged``. So does an exception in
        compiled code; one in plain Python is raised to the caller.
    parameters : (n,) array
        Numbers handed to every call.
    state : (m,) array
        Memory at the start of a run; the run works on a copy.
    signals : tuple of Signal
        Names of the leading entries of the state, which the loop logs after every call.

    Raises
    ------
    InputError
        The numbers are not one-dimensional arrays, or the signals do not fit the state.
    """

    name: str
    step: Callable[..., Any]
    parameters: NDArray[np.float64]
    state: NDArray[np.float64]
    signals: tuple[Signal, ...] = ()

    def __post_init__(self) -> None:
        for field in ("parameters", "state"):
            numbers = np.ascontiguousarray(getattr(self, field), dtype=np.float64)
            if np.ndim(getattr(self, field)) != 1:
                raise InputError(
                    f"law {self.name}: expected {field} as a one-dimensional array, received {numbers.shape}"
                )
            object.__setattr__(self, field, numbers)  # compiled code takes this layout alone
        if width(self.signals) > len(self.state):
            raise InputError(
                f"law {self.name}: expected signals of at most {len(self.state)} numbers, the size of its"
                f" state, received {width(self.signals)}"
            )
        names = [signal.name for signal in (*SIGNALS, *self.signals)]
        if twice := {name for name in names if names.count(name) > 1}:
            raise InputError(f"law {self.name}: expected new names of signals, received {', '.join(twice)}")
