"""What a model may lack: parameters that are not varied, their size in the data, and their effect on others.

Small departures of them, such as a scatter of the gains of the groups, hardly change the mean square of the
residuals, but move the identified values by several of the deviations that the noise gives. Each kind of
parameter that is not varied is a variance component: departures of its members with one standard deviation,
the most likely one for the gradient of the cost by them. It widens the intervals if the likelihood rises.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spheretwin.machine.parameters import KINDS, Parameter, ParameterKind, members
from spheretwin.machine.windows import Shooting, normal_equations
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError

if TYPE_CHECKING:
    from spheretwin.machine.identification import Problem


CREDIBLE, SHARE = 1.0, 0.6
"""Rise of the log likelihood from which a component counts, and the share of the largest that widens."""

# Standard deviations that are tried, of the size of a kind, and the share of the information of the members
# alone below which a direction is the error of the slopes.
_DEVIATIONS = np.exp(np.linspace(-12.0, 4.0, 161))
_LEFT = 1e-5


class VarianceComponent(NamedTuple):
    """A kind of parameter that is not varied, with the departures of its members that data suggest."""

    parameters: tuple[Parameter, ...]
    values: Array
    """Of the scenario."""
    deviation: float
    """Most likely standard deviation of the members."""
    gain: float
    """Rise of the log likelihood of the training windows by it."""
    departures: Array
    """Most likely ones of the members under this deviation."""
    slopes: Array
    """(p, members): change of the best values by a departure."""


class Suggestion(NamedTuple):
    """A kind of parameter that would improve the model."""

    what: str
    gain: float
    """Rise of the log likelihood of the held-out windows."""
    chi2: float
    """Mean square of the held-out windows with it."""
    member: str
    """Parameter with the largest departure."""
    departure: float
    unit: str


def components(problem: Problem, values: Array) -> list[VarianceComponent]:
    """Return the kinds of parameters that are not varied, at the best values of those that are.

    Parameters
    ----------
    problem : Problem
    values : (p,) array
        Best values of its parameters.
    """
    by_kind = {kind: _members(problem, kind) for kind in KINDS.values()}
    others = [parameter for parameters in by_kind.values() for parameter in parameters]
    fixed = np.array([problem.machine.nominal(parameter) for parameter in others])
    parts = Shooting(problem.train.windows, [*problem.parameters, *others]).parts(
        np.append(values, fixed), slopes=True
    )
    count = len(values)
    information, gradient = normal_equations(parts)
    weights = problem.deviations**-2
    known = information[:count, :count] + np.diag(weights)
    slopes = -np.asarray(np.linalg.solve(known, information[:count, count:]), np.float64)
    left = information[count:, count:] + information[count:, :count] @ slopes
    along = gradient[count:] + slopes.T @ (gradient[:count] + weights * (values - problem.initial))
    alone = np.diag(information)[count:]
    found = []
    for kind, parameters in by_kind.items():
        place = [others.index(parameter) for parameter in parameters]
        if place and alone[place].max() > 0:
            block = left[np.ix_(place, place)]
            deviation, gain = _most_likely(along[place], block, kind.size, _LEFT * alone[place].max())
            inner = block + np.eye(len(place)) / max(deviation, 1e-9 * kind.size) ** 2
            departures = -np.linalg.solve(inner, along[place])
            found.append(
                VarianceComponent(
                    tuple(parameters), fixed[place], deviation, gain, departures, slopes[:, place]
                )
            )
    return found


def _members(problem: Problem, kind: ParameterKind) -> list[Parameter]:
    """Return the parameters of a kind that are not varied, and are the same in all logs."""
    return [
        parameter
        for parameter in members(kind, problem.machine.model.actuator)
        if parameter not in problem.parameters
        and len({machine.nominal(parameter) for machine in problem.machines}) == 1
    ]


def _most_likely(gradient: Array, information: Array, size: float, least: float) -> tuple[float, float]:
    """Return the most likely deviation of departures, and the rise of the log likelihood by it.

    Without departures the gradient has the covariance V of the information, with them V + τ² V².
    """
    values, directions = np.linalg.eigh(information)
    seen = values > least
    values, along = values[seen], (directions.T @ gradient)[seen]
    deviations = size * _DEVIATIONS
    more = 1 + values * deviations[:, None] ** 2
    gains = 0.5 * np.sum(along**2 / values * (1 - 1 / more) - np.log(more), axis=1)
    best = int(np.argmax(gains))
    return (float(deviations[best]), float(gains[best])) if gains[best] > 0 else (0.0, 0.0)


def widening(found: Sequence[VarianceComponent], covariance: Array) -> Array:
    """Return the width of the interval of each parameter over that which noise alone gives, (p,).

    Of the components that explain most, that with the largest effect on a parameter counts.
    """
    least = max(CREDIBLE, SHARE * max((one.gain for one in found), default=0.0))
    effects = [
        one.deviation**2 * np.sum(one.slopes**2, axis=1) / np.diag(covariance)
        for one in found
        if one.gain >= least
    ]
    return np.asarray(np.sqrt(1 + np.max([*effects, np.zeros(len(covariance))], axis=0)))


def suggestions(
    problem: Problem, values: Array, found: Sequence[VarianceComponent]
) -> tuple[Suggestion, ...]:
    """Return the kinds that improve the held-out windows, the best first; arguments as in `components`."""
    before = sum(part.squares for part in problem.held_out.parts(values, slopes=False))
    ranked = []
    for one in found:
        kind, largest = one.parameters[0].kind, int(np.argmax(np.abs(one.departures)))
        varied = Shooting(problem.held_out.windows, [*problem.parameters, *one.parameters])
        count = len(one.parameters)
        least = np.append(problem.least, [kind.least] * count)
        most = np.append(problem.most, [kind.most] * count)
        moved = np.append(values + one.slopes @ one.departures, one.values + one.departures)
        try:
            parts = varied.parts(np.clip(moved, least, most), slopes=False)
        except InputError:  # no machine has these departures
            continue
        squares = sum(part.squares for part in parts)
        if (gain := 0.5 * (before - squares)) >= CREDIBLE:
            chi2 = squares / sum(part.used for part in parts)
            what = kind.name if len(one.parameters) > 1 else one.parameters[0].name
            member, departure = one.parameters[largest].name, float(one.departures[largest])
            ranked.append(Suggestion(what, gain, chi2, member, departure, kind.unit))
    return tuple(sorted(ranked, key=lambda one: -one.gain))
