"""Identification: parameters of a machine from logs, with intervals, refusals and held-out data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import count
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field
from scipy.optimize import least_squares
from scipy.stats import chi2

from spheretwin.machine.discrepancy import Suggestion, components, suggestions, widening
from spheretwin.machine.intervals import LeastSquaresCost, Uncertainty, interval
from spheretwin.machine.log import Log
from spheretwin.machine.parameters import Machine, Parameter, priors, selected, short_names
from spheretwin.machine.refusals import (
    CORRELATED,
    TELLING,
    WORST,
    Refusal,
    correlation_sentences,
    refusal_of,
    unidentifiable,
)
from spheretwin.machine.row_order import align_rows
from spheretwin.machine.validation import ResidualFit, fit_of
from spheretwin.machine.windows import Part, Shooting, Window, windows_of
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.fields import SettingsModel

_MOST_EVALUATIONS = 30

# Probability that the values of a right scenario differ from those found by more than is accepted.
_BY_CHANCE = 1e-3


class IdentifySettings(SettingsModel):
    """Settings of an identification."""

    window_s: Annotated[float, Field(gt=0, le=60)] = Field(0.2, description="length of a window, s")
    held_out: Annotated[float, Field(ge=0.1, le=0.5)] = Field(
        0.25, description="share of the windows that only judge the result, spread evenly over the logs"
    )
    nuisance: bool = Field(
        True, description="whether errors that the data sheets of sensors and drive state are estimated too"
    )
    least_improvement: Annotated[float, Field(ge=0, lt=1)] = Field(
        0.05, description="relative decrease of the held-out error that a twin needs"
    )
    chi2_limit: Annotated[float, Field(gt=0, lt=1)] = Field(
        0.1, description="largest difference of the held-out mean square from 1, in the noise of the sensors"
    )
    suggest: bool = Field(
        False, description="whether parameters that are not varied are ranked by what they would improve"
    )


class IdentifiedValue(NamedTuple):
    """Value of a parameter."""

    value: float
    interval: tuple[float, float]
    """95 %."""
    unit: str
    widening: float = 1.0
    """Width of the interval over that which noise alone gives: what the model may lack widens it."""


class Identified(NamedTuple):
    """Result of `identify`."""

    accepted: bool
    parameters: dict[str, IdentifiedValue]
    refused: tuple[Refusal, ...]
    correlations: tuple[str, ...] = ()
    """Sentences on parameters that are nearly indistinguishable."""
    train: ResidualFit | None = None
    held_out: ResidualFit | None = None
    held_out_before: ResidualFit | None = None
    improvement: float | None = None
    """Relative decrease of the held-out error."""
    shortcomings: tuple[str, ...] = ()
    """What the values lack to be accepted."""
    covariance: Array | None = None
    fields: Mapping[str, Any] = MappingProxyType({})
    """Fields of a scenario with the found values."""
    nothing_to_correct: bool = False
    """True if the values of the scenario do not differ from those found: the twin has these all the same."""
    suggestions: tuple[Suggestion, ...] = ()
    """Parameters that are not varied and would improve the held-out windows; empty unless requested."""

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it is not accepted."""
        return (*(one.why for one in self.refused), *self.shortcomings)

    @property
    def uncertainty(self) -> Uncertainty | None:
        """Uncertainty of the found values; None if there are none."""
        values = {name: one.value for name, one in self.parameters.items()}
        return None if self.covariance is None else Uncertainty.of(values, self.covariance)


def identify(
    logs: Log | Sequence[Log],
    scenario: str,
    parameters: Sequence[str],
    changes: Mapping[str, Any] | None = None,
    settings: IdentifySettings | None = None,
    report: Callable[[int, int], object] = lambda done, most: None,
) -> Identified:
    """Identify parameters of a machine.

    Parameters
    ----------
    logs : Log or sequence of Log
        Each with its conditions, such as a known payload.
    scenario : str
        Name or file of the scenario that describes the machine otherwise.
    parameters : sequence of str
        Names of `parameters.KINDS`, of whole kinds or of parts.
    changes : mapping, optional
        Fields of the scenario by dotted name and their values.
    settings : IdentifySettings, optional
    report : callable
        Takes the evaluations that are done and the largest number of them.

    Raises
    ------
    InputError
        A name is unknown, the scenario cannot be used, a log does not fit it, or its windows are too few.
    """
    settings = settings or IdentifySettings()
    logs = [logs] if isinstance(logs, Log) else list(logs)
    problem = Problem(logs, scenario, parameters, changes or {}, settings)
    if refused := problem.refusals(problem.initial):
        return Identified(False, {}, refused)
    values, information, train = problem.solve(report)
    if refused := problem.refusals(values):
        return Identified(False, {}, refused)
    covariance = np.asarray(np.linalg.inv(information), np.float64)
    return problem.result(values, covariance, train)


def identifiability(log: Log, scenario: str, changes: Mapping[str, Any] | None = None) -> tuple[str, ...]:
    """Return sentences on the parameters that a log determines, each alone and all together.

    Raises
    ------
    InputError
        The scenario cannot be used, or the log is shorter than a few windows.
    """
    problem = Problem([log], scenario, TELLING, changes or {}, IdentifySettings(nuisance=False))
    information, _ = problem.normal(problem.initial)
    alone = np.diag(information) * problem.sizes**2 >= WORST
    lines = []
    for can, verb in ((True, "determines"), (False, "does not determine")):
        chosen = [one for one, known in zip(problem.requested, alone, strict=True) if known == can]
        if chosen:
            lines.append(f"each alone, the log {verb} {', '.join(short_names(chosen, problem.requested))}")
    return (*lines, *(one.why for one in problem.refusals(problem.initial)))


class Problem:
    """Least squares of an identification; the arguments are those of `identify`."""

    def __init__(
        self,
        logs: Sequence[Log],
        scenario: str,
        names: Sequence[str],
        changes: Mapping[str, Any],
        settings: IdentifySettings | None = None,
    ) -> None:
        self.settings = settings = settings or IdentifySettings()
        logs = [align_rows(log) for log in logs]
        machines = [Machine(scenario, {**changes, **log.conditions}) for log in logs]
        self.machines, self.machine = machines, machines[0]
        self.requested = selected(names, self.machine.model.actuator)
        if not self.requested:
            raise InputError("identification: expected at least one parameter, received none")
        prior: dict[Parameter, float] = {}
        if settings.nuisance:
            for machine, log in zip(machines, logs, strict=True):
                prior |= priors(machine, log)
        nuisance = [parameter for parameter in prior if parameter not in self.requested]
        self.parameters: list[Parameter] = [*self.requested, *nuisance]
        self.initial = np.array([self.machine.nominal(parameter) for parameter in self.parameters])
        # A requested parameter has no prior: its interval comes from the data alone.
        self.deviations = np.array([*[np.inf] * len(self.requested), *[prior[one] for one in nuisance]])
        self.least = np.array([parameter.kind.least for parameter in self.parameters])
        self.most = np.array([parameter.kind.most for parameter in self.parameters])
        self.sizes = np.array([parameter.kind.size for parameter in self.parameters])
        train, held_out = _split(logs, machines, settings)
        self.train = Shooting(train, self.parameters)
        self.held_out = Shooting(held_out, self.parameters)

    def refusals(self, values: Array) -> tuple[Refusal, ...]:
        """Return the combinations of requested parameters that no data determine at some values."""
        information, _ = self.normal(values)
        combinations = unidentifiable(information * np.outer(self.sizes, self.sizes), self.requested)
        return combinations or self._without_reference()

    def _without_reference(self) -> tuple[Refusal, ...]:
        """Return torque, inertia and friction as one combination if no log has a known payload.

        A cable or gimbal rings of the scenario would be one in the model, but nobody has measured them.
        """
        kinds = {one.kind.name for one in self.requested}
        is_payload_known = "plant.payload_kg" not in kinds and any(
            machine.model.scenario.plant.payload_kg for machine in self.machines
        )
        if is_payload_known or not kinds.issuperset({"torque_scale", "plant.modelling_error"}):
            return ()
        together = [one for one in self.requested if one.kind.name in TELLING]
        return (refusal_of(together, self.requested),)

    def information(self) -> tuple[Array, list[str]]:
        """Return the information of the training windows on the requested parameters, and their names.

        Nuisance parameters are eliminated; without any information, a parameter has that of its size times
        1000.
        """
        information, _ = self.normal(self.initial)
        known = information + np.diag((1e3 * self.sizes) ** -2.0)
        covariance = np.linalg.inv(known)[: len(self.requested), : len(self.requested)]
        return np.linalg.inv(covariance), [parameter.name for parameter in self.requested]

    def solve(self, report: Callable[[int, int], object]) -> tuple[Array, Array, list[Part]]:
        """Return the best values, their information, and the windows; `report` is that of `identify`."""
        latest: dict[bytes, tuple[Array, Array, Array, list[Part]]] = {}
        evaluations = count(1)

        def evaluated(scaled: Array) -> tuple[Array, Array, Array, list[Part]]:
            """Return residuals and slopes in the few directions of the slopes; then information, windows."""
            if (key := scaled.tobytes()) not in latest:
                latest.clear()
                values = self.initial + scaled * self.sizes
                parts = self.train.parts(values, slopes=True)
                information, gradient = self._normal(parts, values)
                factor = np.linalg.cholesky(information * np.outer(self.sizes, self.sizes))
                along = np.linalg.solve(factor, gradient * self.sizes)
                across = max(self._squares(parts, values) - float(along @ along), 0.0) ** 0.5
                slopes = np.vstack([factor.T, np.zeros(len(scaled))])
                latest[key] = np.append(along, across), slopes, information, parts
                report(next(evaluations), _MOST_EVALUATIONS)
            return latest[key]

        solution = least_squares(
            lambda scaled: evaluated(scaled)[0],
            np.zeros(len(self.initial)),
            jac=lambda scaled: evaluated(scaled)[1],
            bounds=((self.least - self.initial) / self.sizes, (self.most - self.initial) / self.sizes),
            ftol=1e-10,
            xtol=1e-6,
            max_nfev=_MOST_EVALUATIONS,
        )
        _, _, information, parts = evaluated(solution.x)
        return self.initial + solution.x * self.sizes, information, parts

    def _cost(self, values: Array) -> float:
        """Return half the sum of the squares of all residuals, priors included."""
        return 0.5 * self._squares(self.train.parts(values, slopes=False), values)

    def _squares(self, parts: Sequence[Part], values: Array) -> float:
        departures = (values - self.initial) / self.deviations
        return float(sum(part.squares for part in parts) + departures @ departures)

    def normal(self, values: Array) -> tuple[Array, Array]:
        """Return information and gradient at some values, priors included."""
        return self._normal(self.train.parts(values, slopes=True), values)

    def _normal(self, parts: Sequence[Part], values: Array) -> tuple[Array, Array]:
        """Return information and gradient of all windows and of the priors."""
        weights = self.deviations**-2
        information = sum((part.information for part in parts), np.diag(weights))
        gradient = sum((part.gradient for part in parts), weights * (values - self.initial))
        return information, gradient

    def result(self, values: Array, covariance: Array, train: list[Part]) -> Identified:
        """Return the result, judged by the held-out windows."""
        before = fit_of(self.held_out.parts(self.initial, slopes=False), self.held_out)
        after = fit_of(self.held_out.parts(values, slopes=False), self.held_out)
        improvement = 1 - np.sqrt(after.chi2 / before.chi2)
        lacking = components(self, values)
        widened = widening(lacking, covariance)
        curvature, covariance = covariance, covariance * np.outer(widened, widened)
        is_right = self._is_right(after, values, covariance)
        reasons = [] if is_right else self._reasons(after, improvement)
        cost = LeastSquaresCost(self._cost, self.normal, values, self._cost(values), self.least, self.most)
        fields = self.machine.fields(self.requested, values[: len(self.requested)].tolist())
        estimates = {
            one.name: IdentifiedValue(
                float(values[i]),
                interval(cost, curvature, i, float(widened[i])),
                one.kind.unit,
                float(widened[i]),
            )
            for i, one in enumerate(self.requested)
        }
        return Identified(
            accepted=not reasons,
            parameters=estimates,
            refused=(),
            correlations=tuple(correlation_sentences([*estimates], covariance, CORRELATED)),
            train=fit_of(train, self.train),
            held_out=after,
            held_out_before=before,
            improvement=float(improvement),
            shortcomings=tuple(reasons),
            covariance=covariance[: len(self.requested), : len(self.requested)],
            fields=fields,
            nothing_to_correct=is_right and not improvement >= self.settings.least_improvement,
            suggestions=suggestions(self, values, lacking) if self.settings.suggest else (),
        )

    def _is_right(self, after: ResidualFit, values: Array, covariance: Array) -> bool:
        """True if the model explains the held-out windows with values like those of the scenario."""
        if not abs(after.chi2 - 1) <= self.settings.chi2_limit:
            return False
        count = len(self.requested)
        departures = values[:count] - self.initial[:count]
        distance = departures @ np.linalg.solve(covariance[:count, :count], departures)
        return bool(distance <= chi2.isf(_BY_CHANCE, count))

    def _reasons(self, after: ResidualFit, improvement: float) -> list[str]:
        reasons, limit = [], self.settings.chi2_limit
        if not improvement >= self.settings.least_improvement:
            reasons.append(
                f"expected a held-out error at least {self.settings.least_improvement:.0%} smaller, received"
                f" {improvement:.1%}"
            )
        if not abs(after.chi2 - 1) <= limit:
            reasons.append(
                f"expected a held-out mean square from {1 - limit:g} to {1 + limit:g} of that of the noise,"
                f" received {after.chi2:.3g}: the model lacks something that the machine has"
            )
        return reasons


def _split(
    logs: Sequence[Log], machines: Sequence[Machine], settings: IdentifySettings
) -> tuple[list[Window], list[Window]]:
    """Return windows for training and held-out ones."""
    train: list[Window] = []
    held_out: list[Window] = []
    turn = round(1 / settings.held_out)
    for log, machine in zip(logs, machines, strict=True):
        for number, window in enumerate(windows_of(log, machine, settings.window_s)):
            (held_out if number % turn == turn - 1 else train).append(window)
    if not held_out or not train:
        raise InputError(
            f"identification: expected at least {turn} windows of {settings.window_s:g} s, received"
            f" {len(train) + len(held_out)}"
        )
    return train, held_out
