"""Diagnosis of a change: its explanations and their probabilities.

Explanations are each candidate from some time on, each load for a short time, and two that have no name: a
torque that varies in any way, and a larger variance. The time of the best is refined to a row of the log.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from spheretwin.machine.change_filter import (
    BlockRows,
    ChangeFilter,
    FilterEstimate,
    FilterStep,
    Linearisation,
)
from spheretwin.machine.explanations import (
    BEYOND,
    LOADS,
    NONLINEAR,
    RARE,
    TOLERATED,
    UNNAMED,
    WIDTHS,
    Candidate,
    evidence,
)
from spheretwin.machine.signatures import Begin, PUSH_s, Times
from spheretwin.models.base.arrays import Array

INEXACT = 0.005
"""Share of its evidence that a torque without a name gets from what the slopes of a named change miss."""

NOISE_FACTORS = (1.5, 3.0, 10.0, 100.0)
TORQUES_Nm, TORQUE_TIME_s = (2e-3, 6e-3, 2e-2), 0.1
"""Standard deviations of a torque without a name, and the time over which it varies."""

UNNAMED_LOG_PRIOR = -2.6
"""Of each of the two, like that of a kind."""


class Explanation(NamedTuple):
    """Explanation of what has happened, at its most probable time."""

    log_evidence: float
    """Over no change, its prior included."""
    onset_s: float
    """Time of the last row without the change."""
    lasted_s: float | None = None
    """Duration of a change that is over."""
    candidate: Candidate | None = None
    """None: a change without a name."""
    log_weight: float = 0.0
    """Evidence over that of the most probable time."""
    size: float = 0.0
    variance: float = 0.0
    errors: Array | None = None
    """(6 + p,) errors of state and parameters that a unit has left in the filter."""
    remaining: float = 0.0
    """Squares of the residuals after the onset that it does not explain, less their expected value, over the
    standard deviation of that."""
    replayed_size: float = 0.0
    estimate: FilterEstimate | None = None
    """Of a filter in which the machine has changed by the replayed size."""

    @property
    def name(self) -> str:
        """Name of the change."""
        return self.candidate.name if self.candidate else UNNAMED

    @property
    def direction(self) -> Array:
        """Lasting change of the parameters by a unit."""
        assert self.candidate
        return self.candidate.direction * float(self.lasted_s is None)

    def estimate_after(self, estimate: FilterEstimate) -> FilterEstimate:
        """Return the estimate of the changed machine from that without the change."""
        assert self.errors is not None
        estimate, move = self.estimate or estimate, self.size - self.replayed_size
        variance = self.variance + (NONLINEAR * self.size) ** 2
        return FilterEstimate(
            estimate.state + self.errors[:6] * move,
            estimate.errors + (self.errors[6:] - self.direction) * move,
            estimate.covariance + variance * np.outer(self.errors, self.errors),
        )


def shares_of(explanations: Sequence[Explanation]) -> tuple[dict[str, float], Array]:
    """Return the probabilities of names, the largest first, and those of the explanations."""
    logs = np.array([explanation.log_evidence for explanation in explanations])
    shares = np.exp(logs - logsumexp(logs))
    names: dict[str, float] = {}
    for explanation, share in zip(explanations, shares, strict=True):
        names[explanation.name] = names.get(explanation.name, 0.0) + float(share)
    return dict(sorted(names.items(), key=lambda item: -item[1])), shares


class ChangeDiagnosis:
    """Explanations of the residuals of some steps.

    Parameters
    ----------
    candidates : sequence of Candidate
    steps : sequence of FilterStep
        In order; a change begins in one of them.
    """

    def __init__(self, candidates: Sequence[Candidate], steps: Sequence[FilterStep]) -> None:
        self._candidates, self._steps = candidates, list(steps)
        self._rows = [len(step.block.t_s) for step in self._steps]
        self._squares = np.array([step.squares for step in self._steps])
        self._angles = np.array([len(step.whitened) for step in self._steps])

    def explanations(self) -> list[Explanation]:
        """Return all explanations."""
        coarse = Times(self._candidates, self._steps, list(self._grid()))
        fine = Times(self._candidates, self._steps, sorted(self._near_best(coarse)))
        named = [
            self._best(number, over=over, coarse=coarse, fine=fine)
            for number in range(len(self._candidates))
            for over in (False, True)
            if coarse.places(number, over=over).size
        ]
        shortest_s = PUSH_s[0] + _AT_LIMIT_s
        named = [explanation for explanation in named if (explanation.lasted_s or shortest_s) >= shortest_s]
        return [*named, self._noise(), self._torque(coarse), *self._impossible(coarse)]

    def _grid(self) -> Iterator[Begin]:
        """Yield each candidate in each step; one of a sensor at each row, another with the step."""
        for number, candidate in enumerate(self._candidates):
            for step, rows in enumerate(self._rows):
                yield from ((number, step, row) for row in range(rows if candidate.is_sensor else 1))

    def _near_best(self, coarse: Times) -> set[Begin]:
        """Return each row about the best time of each candidate."""
        near = set()
        for number, candidate in enumerate(self._candidates):
            for over in (False, True):
                places = coarse.places(number, over=over)
                if candidate.is_sensor or not len(places):
                    continue
                best = places[np.argmax(coarse.log_evidence[places])]
                for column in {coarse.first[best], coarse.last[best]} - {-1}:
                    end = int(coarse.begins[column, 1])
                    for step in range(max(end - 1, 0), end + 1):
                        near |= {(number, step, row) for row in range(self._rows[step])}
        return near

    def _best(self, number: int, *, over: bool, coarse: Times, fine: Times) -> Explanation:
        """Return the explanation by a candidate, over or not, at its best time."""
        tables = [(times, times.places(number, over=over)) for times in (coarse, fine)]
        logs = [times.log_evidence[places] for times, places in tables]
        cells = np.log(len(logs[0]))
        per_cell = np.log(max(self._rows)) * (2 if over else 1)
        candidate = self._candidates[number]
        evidence_of_all = logsumexp(np.concatenate([logs[0] - cells, logs[1] - cells - per_cell]))
        chosen = int(np.max(logs[1], initial=-np.inf) > np.max(logs[0]))
        times, places = tables[chosen]
        best = int(places[np.argmax(logs[chosen])])
        gradient, information = float(times.gradient[best]), float(times.information[best])
        size, variance, log_evidence = _fitted(candidate, gradient, information)
        first, last = int(times.first[best]), int(times.last[best])
        step = int(times.begins[first, 1])
        squares = float(np.sum(self._squares[step:])) - 2 * size * gradient + size**2 * information
        onset_s = float(times.onset_s[first])
        return Explanation(
            float(evidence_of_all) + candidate.log_prior,
            onset_s,
            float(times.onset_s[last]) - onset_s if over else None,
            candidate,
            float(evidence_of_all) + candidate.log_prior - log_evidence,
            size,
            variance,
            times.errors(first, last),
            _excess(squares, int(np.sum(self._angles[step:]))),
        )

    def _unnamed(self, logs: Array, onset_s: float) -> Explanation:
        return Explanation(float(logsumexp(logs)) - float(np.log(logs.size)) + UNNAMED_LOG_PRIOR, onset_s)

    def _noise(self) -> Explanation:
        logs = evidence_of_noise(self._squares, self._angles)
        step = int(np.argmax(np.max(logs, axis=0)))
        return self._unnamed(logs, float(self._steps[step].block.t_s[0]))

    def _impossible(self, coarse: Times) -> Iterator[Explanation]:
        """Yield the explanation by a value that is physically impossible, if one would fit."""
        count, number = len(coarse.begins), coarse.begins[:, 0]
        gradient, information = coarse.gradient[:count], coarse.information[:count]
        size, least, most, log_prior = np.array(
            [(one.size, one.least, one.most, one.log_prior) for one in self._candidates]
        ).T[:, number]
        fitted = gradient / np.maximum(information, 1e-300)
        below = fitted < (1 + BEYOND) * least - TOLERATED * size
        beyond = below | (fitted > (1 + BEYOND) * most + TOLERATED * size)
        if np.any(beyond):
            logs = evidence(gradient, information, self._candidates, number, bounded=False) + log_prior
            best = int(np.argmax(np.where(beyond, logs, -np.inf)))
            total = float(logsumexp(logs[beyond])) - float(np.log(len(self._steps))) + float(np.log(RARE))
            yield Explanation(total, float(coarse.onset_s[best]))

    def _torque(self, coarse: Times) -> Explanation:
        """Return the explanation by a torque on the hinges that varies from some time on."""
        hinges = [
            coarse.places(number, over=False)[::_BIN_STEPS]
            for number, candidate in enumerate(self._candidates)
            if candidate.kind.name == LOADS and np.sum(candidate.direction) == 1
        ]
        index, count = np.concatenate(hinges), len(hinges[0])
        steps_to_bins = np.kron(np.eye(len(hinges)), np.eye(count) - np.eye(count, k=-1))
        information = steps_to_bins.T @ coarse.products(index) @ steps_to_bins
        gradient, times_s = steps_to_bins.T @ coarse.gradient[index], coarse.onset_s[hinges[0]]
        logs, onsets_s = [], []
        for first in range(0, count, 3):
            bins = np.concatenate([hinge * count + np.arange(first, count) for hinge in range(len(hinges))])
            apart_s = np.abs(times_s[first:, None] - times_s[None, first:])
            root = np.kron(np.eye(len(hinges)), np.linalg.cholesky(np.exp(-apart_s / TORQUE_TIME_s)))
            values, vectors = np.linalg.eigh(root.T @ information[np.ix_(bins, bins)] @ root)
            power = (vectors.T @ (root.T @ gradient[bins])) ** 2
            for torque_Nm in TORQUES_Nm:
                grows = 1 + torque_Nm**2 * np.maximum(values, 0.0)
                logs.append(0.5 * np.sum(torque_Nm**2 * power / grows) - 0.5 * np.sum(np.log(grows)))
                onsets_s.append(float(times_s[first]))
        return self._unnamed((1 - INEXACT) * np.array(logs), onsets_s[int(np.argmax(logs))])

    def replayed(self, explanation: Explanation, plain: ChangeFilter, machine: Linearisation) -> Explanation:
        """Return the explanation by a replay of its change.

        Slopes say what a small change does. A large one moves the rotor to where slopes differ, and Coulomb
        friction is not linear where a hinge turns back. The replay is linear about the change itself.

        Parameters
        ----------
        explanation : Explanation
            By a candidate.
        plain : ChangeFilter
            Filter without the change.
        machine : Linearisation
            That of the machine without the change.
        """
        candidate, size = explanation.candidate, explanation.size
        assert candidate
        first = next(
            number
            for number, step in enumerate(self._steps)
            if step.block.t_s[-1] > explanation.onset_s + _ROUNDING_s
        )
        for _ in range(_REPLAYS):
            base, changed = size, machine.changed(size * candidate.direction)
            parts, steps, end = _again(self._steps[first:], explanation, plain, [machine, changed, machine])
            begins = [(0, parts.index(part), 0) for part in sorted(set(parts) - {0})]
            times = Times([candidate], steps, begins, push_s=(0.0, inf, 0.0))
            gradient, information = float(times.gradient[-1]), float(times.information[-1])
            size, variance, log_evidence = _fitted(candidate, gradient + information * base, information)
            if abs(size - base) < _CLOSE * abs(base):
                break
        affected = steps[begins[0][1] :]
        squares = sum(step.squares for step in affected)
        squares += (size - base) * ((size - base) * information - 2 * gradient)
        log_ratio = sum(step.cost for step in self._steps[first:]) - sum(step.cost for step in steps)
        log_evidence += log_ratio - base * gradient - 0.5 * base**2 * information + explanation.log_weight
        return explanation._replace(
            log_evidence=log_evidence,
            size=size,
            variance=variance,
            errors=times.errors(int(times.first[-1]), int(times.last[-1])),
            remaining=_excess(squares, sum(len(step.whitened) for step in affected)),
            replayed_size=base,
            estimate=end,
        )


def evidence_of_noise(squares: Array, angles: Array) -> Array:
    """Return the logarithms of the evidence of larger variances from each step on, (factors, steps)."""
    squares, angles = (np.cumsum(values[::-1])[::-1] for values in (squares, angles))
    factors = np.array(NOISE_FACTORS)[:, None]
    return 0.5 * squares * (1 - 1 / factors) - 0.5 * angles * np.log(factors)


def _fitted(candidate: Candidate, gradient: float, information: float) -> tuple[float, float, float]:
    """Return the most probable size of a change, its variance, and its evidence."""
    total = information + 1 / (WIDTHS[-1] * candidate.size) ** 2
    size = float(np.clip(gradient / total, candidate.least, candidate.most))
    logs = evidence(np.array([gradient]), np.array([information]), [candidate], np.zeros(1, np.int64))
    return size, 1 / total, float(logs[0])


def _excess(squares: float, angles: int) -> float:
    """Return squares of normal numbers less their expected value, over the standard deviation of that."""
    return (squares - angles) / float(np.sqrt(2 * max(angles, 1)))


def _again(
    steps: Sequence[FilterStep],
    explanation: Explanation,
    plain: ChangeFilter,
    machines: Sequence[Linearisation],
) -> tuple[list[int], list[FilterStep], FilterEstimate]:
    """Filter steps again, with machines before, during and after a change.

    Returns the number of the machine of each step, these steps, and the estimate at their end.
    """
    onset_s, lasted_s = explanation.onset_s, explanation.lasted_s
    cuts_s = [onset_s] if lasted_s is None else [onset_s, onset_s + lasted_s]
    changed, parts, again = plain.copy(steps[0].before), [], []
    for step in steps:
        for part, rows in _parts(step, cuts_s):
            parts.append(part)
            again.append(changed.advance(machines[part].block(rows, changed.estimate.state)))
    return parts, again, changed.estimate


def _parts(step: FilterStep, cuts_s: Sequence[float]) -> Iterator[tuple[int, BlockRows]]:
    """Yield the rows of a step between times, after how many of these."""
    times_s, first = step.block.t_s, 0
    edges = [int(np.searchsorted(times_s, cut_s + _ROUNDING_s)) for cut_s in cuts_s]
    for part, last in enumerate([*edges, len(times_s)]):
        if last > first:
            yield part, step.block.rows.part(first, last)
            first = last


# Replays until the size stays within this share.
_REPLAYS, _CLOSE = 3, 0.05

_AT_LIMIT_s = 5e-3  # a push as short as possible is a kick, or another torque that varies

_BIN_STEPS = 3  # in which a torque without a name is constant

_ROUNDING_s = 1e-9
