"""Function V of the proof of AFSM, equation (44), along a run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spheretwin.control.law_components.fuzzy import CENTRES, SHAPE, WIDTH
from spheretwin.control.laws.afsm import AFSM
from spheretwin.paper.experiment import Array
from spheretwin.run import Run

CUT = 1e-3
"""Of the largest singular value: directions of theta that a run hardly excites are left at 0."""


class Descent(NamedTuple):
    """Course of V along a run."""

    rises: float
    """Share of the ticks at which it rose."""
    risen: float
    """Sum of all rises, over V at the start."""
    fallen: float
    """Decrease from start to end, over V at the start."""
    of_parameters: float
    """Share of V at the start that the errors of the parameters make up."""


def descent(run: Run) -> Descent | None:
    """Course of V of a run; None for another law, or level, than that of the proof."""
    gains = run.scenario.controller
    if not isinstance(gains, AFSM) or gains.level != "acceleration" or len(run.telemetry) < 2:
        return None
    totals, of_parameters = zip(*(_of_axis(run, gains, axis) for axis in range(3)), strict=True)
    total, parameters = np.sum(totals, axis=0), sum(of_parameters)
    steps = np.diff(total)
    up = steps[steps > 0]
    return Descent(
        rises=len(up) / len(steps),
        risen=float(up.sum() / total[0]),
        fallen=float(1 - total[-1] / total[0]),
        of_parameters=float(parameters / total[0]),
    )


def _of_axis(run: Run, gains: AFSM, axis: int) -> tuple[Array, float]:
    """V of an axis at all ticks but the last, and the share of the parameters' errors in the first."""
    table, period_s = run.telemetry, gains.period_s
    s, mass = table["sliding_s"][:, axis], 1 + run.scenario.plant.modelling_error
    psi = regressor(table["qdot_rad_s"][:, axis], table["q_rad"][:, axis])
    theta = consequents(psi, s, gains.fuzzy_rate[axis], period_s)
    v = table["torque_command_Nm"][:-1, axis] / np.array(run.scenario.nominal.inertia_kg_m2)[axis]
    needed = v - mass * np.diff(s) / period_s
    best = _fitted(psi[:-1], needed)
    bound = np.abs(needed - psi[:-1] @ best).max()
    of_theta = np.sum((theta[:-1] - best) ** 2, axis=1) / gains.fuzzy_rate[axis]
    of_xi = (table["switching_gain"][:-1, axis] - bound) ** 2 / gains.switching_rate[axis]
    of_zeta = table["bound_gain"][:-1, axis] ** 2 / gains.bound_rate[axis]
    errors = (of_theta + of_xi + of_zeta) / 2
    return mass * s[:-1] ** 2 / 2 + errors, float(errors[0])


def _fitted(psi: Array, needed: Array) -> Array:
    """Return the solution by least squares, without the directions that `CUT` leaves out.

    The squares of the singular values are known to 1e-10 where they are kept, in a tenth of the time.
    """
    squares, directions = np.linalg.eigh(psi.T @ psi)
    kept = squares > CUT**2 * squares[-1]
    return directions[:, kept] @ ((directions[:, kept].T @ (psi.T @ needed)) / squares[kept])


def regressor(rate: Array, angle: Array) -> Array:
    """(n, 75) regressor Psi of an axis."""
    of_rate, of_angle = _memberships(rate), _memberships(angle)
    psi = (of_rate[:, :, None] * of_angle[:, None, :]).reshape(len(rate), -1)
    return np.hstack([psi, psi * rate[:, None], psi * angle[:, None]])


def consequents(psi: Array, s: Array, fuzzy_rate: float, period_s: float) -> Array:
    """(n, 75) estimates theta at each tick, from 0 on (43)."""
    steps = -fuzzy_rate * period_s * s[:, None] * psi
    return np.vstack([np.zeros(psi.shape[1]), np.cumsum(steps, axis=0)[:-1]])


def _memberships(x: Array) -> Array:
    degrees = np.exp(-SHAPE * ((x[:, None] - np.array(CENTRES)) / (2 * WIDTH)) ** 2)
    return degrees / degrees.sum(axis=1, keepdims=True)
