"""Residual of a potentiometer as its definition reads: a slow copy for tests."""

import numpy as np
from scipy.optimize import minimize_scalar


def residual_of(phases):
    """Return the residual over the turn of the track, rad, scaled to 1 at its largest magnitude.

    The peak is found on a grid and searched for further.
    """
    order = np.arange(1, 5)

    def shape(turn):
        return np.sum(np.cos(np.multiply.outer(turn, order) + phases) / order**2, axis=-1)

    grid = np.linspace(-np.pi, np.pi, 10_000)
    top = grid[np.argmax(np.abs(shape(grid)))]
    peak = minimize_scalar(
        lambda turn: -abs(shape(turn)),
        bounds=(top - 1e-3, top + 1e-3),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return lambda turn: shape(turn) / -peak.fun
