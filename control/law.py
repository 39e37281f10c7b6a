"""What a control law is to the loop: one function of fixed signature, its numbers, its state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.models.telemetry import Signal

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
        compiles runs at the speed of the shipped laws.
    parameters : (n,) array
        Numbers handed to every call.
    state : (m,) array
        Memory at the start of a run; the run works on a copy.
    signals : tuple of Signal
        Names of the leading entries of the state, which the loop logs after every call.
    """

    name: str
    step: Callable[..., Any]
    parameters: NDArray[np.float64]
    state: NDArray[np.float64]
    signals: tuple[Signal, ...] = ()
