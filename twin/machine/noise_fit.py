"""Noise of the plant and shift of the currents in a log, by maximum likelihood."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

from spheretwin.machine.log import Log
from spheretwin.machine.model import Model
from spheretwin.machine.state_estimation import Shadow, ShadowSettings
from spheretwin.models.base.errors import InputError

# Three numbers need no more: the likelihood is within 0.1 of its largest after some 60 evaluations.
_MOST_EVALUATIONS = 150

# Step of the differences for the curvature, and the start of the search for the shift.
_SHIFT_STEP_s = 2e-4

_LEAST = 1e-6  # of a noise: N·m and N·m·√s


class NoiseFit(NamedTuple):
    """Result of `fit_noise`."""

    settings: ShadowSettings
    shift_interval_s: tuple[float, float]
    """95 % interval of the shift, from the curvature of the likelihood; infinite if there is none."""
    log_likelihood: float


def fit_noise(log: Log, model: Model, settings: ShadowSettings | None = None) -> NoiseFit:
    """Return the settings of the shadow under which a log is most likely.

    The growth of the disturbance, the white torque and the shift of the currents are fitted. A shift is a
    delay and an offset between the clocks of currents and angles: a log cannot tell one from the other.

    Parameters
    ----------
    log : Log
    model : Model
    settings : ShadowSettings, optional
        Start of the search, and the settings that are not fitted.

    Raises
    ------
    InputError
        The log does not fit the model, or no settings make it likely.
    """
    start = settings or ShadowSettings()

    def given(values: Any) -> ShadowSettings:
        walk, noise = np.exp(np.clip(values[:2], np.log(_LEAST), np.log(1e2)))
        shift_s = float(np.clip(values[2] * _SHIFT_STEP_s, -1.0, 1.0))
        return start.model_copy(
            update={"disturbance_walk_Nm": float(walk), "torque_noise_Nm_s": float(noise), "shift_s": shift_s}
        )

    def unlikely(values: Any) -> float:
        running = Shadow(model, given(values))
        running.advance(log)
        return -running.log_likelihood

    first = np.array(
        [
            np.log(max(start.disturbance_walk_Nm, _LEAST)),
            np.log(max(start.torque_noise_Nm_s, _LEAST)),
            start.shift_s / _SHIFT_STEP_s,
        ]
    )
    simplex = first + np.vstack([np.zeros(3), np.diag([1.0, 1.0, 2.0])])
    options = {"initial_simplex": simplex, "maxfev": _MOST_EVALUATIONS, "xatol": 0.02, "fatol": 0.05}
    solution = minimize(unlikely, first, method="Nelder-Mead", options=options)
    if not np.isfinite(solution.fun):
        raise InputError(f"log {log.name}: expected angles that a model can follow, received none")
    neighbours = [unlikely(solution.x + np.array([0.0, 0.0, step])) for step in (-1.0, 1.0)]
    curvature = (neighbours[0] + neighbours[1] - 2 * solution.fun) / _SHIFT_STEP_s**2
    half = 1.96 / np.sqrt(curvature) if curvature > 0 else np.inf
    fitted = given(solution.x)
    return NoiseFit(fitted, (fitted.shift_s - half, fitted.shift_s + half), -float(solution.fun))
