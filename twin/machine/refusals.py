"""Refusals: parameters that data do not determine, and sentences on those that go together."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from spheretwin.machine.parameters import Parameter, short_names
from spheretwin.models.base.arrays import Array

TELLING = (
    "torque_scale",
    "plant.modelling_error",
    "plant.coulomb_Nm",
    "plant.viscous_Nm_s",
    "plant.payload_kg",
)
"""Parameters of which a check of a log says whether it determines them."""

CORRELATED = 0.95
"""Correlation from which two parameters are hardly distinguished."""

# Information of a direction in which the data only determine changes that matter; with less it is refused. In
# it, parameters with at least this share of the largest take part.
WORST, _SHARE = 1.0, 0.2

# Information that is left of that of the parameters alone: less of it is the error of the slopes, which are
# differences over a thousandth of a parameter's size.
_LEFT = 1e-5


class Refusal(NamedTuple):
    """Parameters that the data do not determine."""

    parameters: tuple[str, ...]
    why: str


def unidentifiable(information: Array, requested: Sequence[Parameter]) -> tuple[Refusal, ...]:
    """Return the combinations of parameters that data do not determine.

    Parameters
    ----------
    information : (p, p) array
        Of the parameters in units of their sizes; requested ones first.
    requested : sequence of Parameter
    """
    values, directions = np.linalg.eigh(information)
    together: list[set[int]] = []
    for value, direction in zip(values, directions.T, strict=True):
        share = np.abs(direction[: len(requested)])
        least = max(WORST, _LEFT * float(direction**2 @ np.diag(information)))
        if value >= least or share.max() < _SHARE:
            continue
        # Several such directions of the same parameters are any basis of these: one refusal.
        named = {int(place) for place in np.flatnonzero(share >= _SHARE * share.max())}
        named = named.union(*(others for others in together if others & named))
        together = [others for others in together if not others & named] + [named]
    return tuple(refusal_of([requested[place] for place in sorted(places)], requested) for places in together)


def refusal_of(parameters: Sequence[Parameter], requested: Sequence[Parameter]) -> Refusal:
    """Return the refusal of parameters that no data determine among the requested ones."""
    return Refusal(tuple(one.name for one in parameters), _why(short_names(parameters, requested)))


def _why(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"{names[0]} cannot be determined from these data: they hardly depend on it"
    listed = f"{', '.join(names[:-1])} and {names[-1]}"
    return (
        f"{listed} cannot be distinguished in these data: changed together, they give the same angles;"
        " fix one, or add a log under another known condition, such as a payload"
    )


def correlation_sentences(names: Sequence[str], covariance: Array, least: float) -> list[str]:
    """Return sentences on parameters whose errors go together, the closest first.

    Parameters
    ----------
    names : sequence of str
    covariance : (p, p) array
        Those of the names first.
    least : float
        Correlation from which a pair is named. Above 0.95, the interval of a parameter is more than three
        times as wide as with the other one known.
    """
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    pairs = sorted(combinations(range(len(names)), 2), key=lambda pair: -abs(correlation[pair]))
    return [
        f"{names[i]} and {names[j]} are {'hardly' if abs(correlation[i, j]) > CORRELATED else 'not well'}"
        f" distinguished in these data (correlation {correlation[i, j]:+.3f})"
        for i, j in pairs
        if abs(correlation[i, j]) > least
    ]
