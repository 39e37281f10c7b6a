"""Explanations of what a machine shows: changes that are watched for, their evidence, and their shares.

The evidence of a change is the likelihood of the residuals with it over that without, averaged over its size
and its time. Its size is normal about 0, with one of several widths, within the range that is physically
possible. Explanations have equal priors by kind; a kind's is shared by its members.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr, logsumexp

from spheretwin.machine.parameters import Parameter, ParameterKind
from spheretwin.models.base.arrays import Array, Integers

UNNAMED = "unexplained"

LOADS = "plant.modelling_torque_Nm"
"""Kind of the torques on the hinges."""

SIZES = {"torque_scale": 0.03, "plant.group_gain": 0.1, "sensors.angle_offset_rad": 1e-3}
"""Sizes of changes that are watched for, where they are not those of `identify`.

A window tells an offset and the torque of all groups well, and that of a single group hardly: there, what
the plant neglects looks like a change by 0.03.
"""

TOLERATED = 0.25
"""Standard deviation of an error of the twin, as a share of the size of a change that matters."""

NONLINEAR = 0.03
"""Share of a large change that slopes may miss: of its size, and of what it explains."""

WIDTHS = np.array([1.0, 3.0, 10.0, 30.0])
"""Standard deviations of changes, in units of those that matter; equally probable."""

RANGES = {"torque_scale": (0.0, 1.5), "plant.group_gain": (0.0, 1.5), "sensors.angle_offset_rad": (-0.5, 0.5)}
"""Least and largest value of a parameter that is physically possible, besides those of its field."""

UNLIKELY, RARE = ("delay_s", "sensor_gain_error"), 0.1
"""Kinds that change rarely, and their prior over that of others."""

_TOGETHER = ("plant.coulomb_Nm", "plant.viscous_Nm_s", "plant.modelling_torque_Nm")


BEYOND = 0.1
"""Share of a bound by which the estimate of a value within it may exceed it."""


class Candidate(NamedTuple):
    """Change that is watched for."""

    name: str
    kind: ParameterKind
    direction: Array
    """(p,) of the parameters."""
    size: float
    least: float
    most: float
    log_prior: float

    @property
    def is_sensor(self) -> bool:
        """True if the change moves the angles at once, and the rotor not."""
        return self.kind.name.startswith("sensor")


def size_of(kind: ParameterKind) -> float:
    """Return the size of a change that matters."""
    return SIZES.get(kind.name, kind.size)


def candidates_of(
    parameters: Sequence[Parameter], values: Array, watched: Sequence[Parameter]
) -> list[Candidate]:
    """Return each parameter, and all hinges together for friction and load.

    Parameters
    ----------
    parameters : sequence of Parameter
    values : (p,) array
    watched : sequence of Parameter
        Those whose changes have names.
    """
    kinds = list(dict.fromkeys(one.kind for one in parameters))
    weights = {kind: RARE if kind.name in UNLIKELY else 1.0 for kind in kinds}
    candidates = []
    for kind in kinds:
        places = [place for place, one in enumerate(parameters) if one.kind is kind]
        directions = {parameters[place].name: np.eye(len(parameters))[place] for place in places}
        if kind.name in _TOGETHER and len(places) == 3:
            directions[f"{kind.name} of all hinges"] = np.sum(list(directions.values()), axis=0)
        log_prior = float(np.log(weights[kind] / sum(weights.values()) / len(directions)))
        low, high = RANGES.get(kind.name, (kind.least, kind.most))
        for name, direction in directions.items():
            own = values[direction > 0]
            changed = {one for one, share in zip(parameters, direction, strict=True) if share}
            label = name if changed & set(watched) else UNNAMED
            least, most = float(np.max(low - own)), float(np.min(high - own))
            candidates.append(Candidate(label, kind, direction, size_of(kind), least, most, log_prior))
    return candidates


def evidence(
    gradient: Array,
    information: Array,
    candidates: Sequence[Candidate],
    number: Integers,
    *,
    bounded: bool = True,
) -> Array:
    """Return the logarithms of the evidence of changes over no change, (n,).

    Parameters
    ----------
    gradient, information : (n,) arrays
        Of the logarithm of the likelihood by the change.
    candidates : sequence of Candidate
    number : (n,) array of int
        Candidate of each change.
    bounded : bool
        False: any value is possible.
    """
    size, least, most = np.array([(one.size, one.least, one.most) for one in candidates]).T[:, number]
    precision = 1 / (WIDTHS[:, None] * size) ** 2
    total = information + precision
    mean, deviation = gradient / total, 1 / np.sqrt(total)
    each = 0.5 * gradient**2 / total + 0.5 * np.log(precision / total)
    if bounded:
        each += _log_mass(least, most, mean, deviation) - _log_mass(least, most, 0.0, 1 / np.sqrt(precision))
    return logsumexp(each, axis=0) - np.log(len(WIDTHS))


def _log_mass(least: Array, most: Array, mean: Array | float, deviation: Array) -> Array:
    """Return the logarithm of the probability of a range under a normal distribution."""
    low, high = (least - mean) / deviation, (most - mean) / deviation
    flip = low > 0  # in the upper tail by symmetry
    low, high = np.where(flip, -high, low), np.where(flip, -low, high)
    top, bottom = log_ndtr(high), log_ndtr(low)
    return np.maximum(top + np.log(-np.expm1(np.minimum(bottom - top, -1e-300))), -1e4)
