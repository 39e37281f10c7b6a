"""Signatures of changes: what a unit of each, from some time on, leaves in the residuals of the filter.

A change by δ gives the residuals the mean δ s. The signature s follows from the filter: it contains what the
filter takes for an error of the state (Willsky and Jones 1976). So a change is not lost when the estimate
adopts it. Candidates begin, and loads also end, at given times.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.machine.change_filter import FilterStep, LinearBlock, remembered
from spheretwin.machine.explanations import LOADS, Candidate, evidence
from spheretwin.models.base.arrays import Array, Booleans, Integers
from spheretwin.models.base.matrices import product

Places = Integers


class Signatures:
    """Changes that have begun, and their signatures as they pass the filter.

    Parameters
    ----------
    candidates : sequence of Candidate

    Attributes
    ----------
    candidate : (n,) array of int
        Number of the candidate of each change.
    onset_s : (n,) array
        Time of the last row without the change.
    gradient, information : (n,) arrays
        Of the logarithm of the likelihood by the change: inner products of the signature with the residuals,
        and with itself.
    errors : (6 + p, n) array
        Errors of state and parameters that the change has left in the filter.
    """

    def __init__(self, candidates: Sequence[Candidate]) -> None:
        self._directions = np.stack([candidate.direction for candidate in candidates], axis=1)
        self._sensor = np.array([candidate.is_sensor for candidate in candidates])
        self.candidate = np.zeros(0, np.int64)
        self.onset_s, self.gradient, self.information = np.zeros((3, 0))
        self.errors = np.zeros((6 + len(self._directions), 0))

    def __len__(self) -> int:
        return len(self.candidate)

    def forget(self, before_s: float) -> None:
        """Forget changes that have begun before a time."""
        kept = self.onset_s > before_s
        self.candidate, self.onset_s = self.candidate[kept], self.onset_s[kept]
        self.gradient, self.information = self.gradient[kept], self.information[kept]
        self.errors = self.errors[:, kept]

    def advance(self, step: FilterStep, candidates: Places, rows: Places) -> Array:
        """Advance over a step, in which changes begin; return the signatures in it (m, n).

        Parameters
        ----------
        step : FilterStep
        candidates, rows : (k,) arrays of int
            Number of the candidate of each change that begins, and rows of the block without it.
        """
        block, old = step.block, len(self)
        starts = np.zeros((len(self.errors), len(rows)))
        starts[6:] = self._directions[:, candidates]
        begun = product(block.slopes, starts) * _shares(block, self._sensor[candidates], rows)
        signature = np.hstack([product(block.slopes, self.errors), begun])
        self.errors = np.hstack([self.errors, starts])
        self.candidate = np.append(self.candidate, candidates)
        self.onset_s = np.append(self.onset_s, block.t_s[0] + (rows - 1) * block.period_s)
        reached, keep = product(block.transition, self.errors), remembered(block.length_s)
        rest = 1 - rows / len(block.t_s)
        reached[:3, old:] *= rest**2
        reached[3:, old:] *= rest
        self.errors[:6] = reached
        self.errors[6:] = keep * self.errors[6:] + (1 - keep) * self._directions[:, self.candidate]
        self.errors -= product(step.gain, signature)
        signature = product(step.whitener, signature)
        before = np.zeros(len(rows))
        self.gradient = np.append(self.gradient, before) + product(step.whitened[None], signature)[0]
        self.information = np.append(self.information, before) + np.sum(signature**2, axis=0)
        return signature


def _shares(block: LinearBlock, sensor: Booleans, rows: Places) -> Array:
    """Return the shares of the complete signature that changes have which begin after some rows, (m, n).

    A torque moves the rotor by the square of its time. The mean of two angles has half of an offset that only
    one of them has.
    """
    row, half = block.row[:, None], block.half[:, None]
    offset = np.where(half & (row == rows), 0.5, row >= rows)
    time = row + np.where(half, 0.5, 1.0)
    moved = np.maximum(time - rows, 0.0) / time
    return np.where(sensor, offset, moved**2)


Begin = tuple[int, int, int]
"""Number of a candidate, step in which it begins, rows of that step without it."""

PUSH_s, AFTER_s = (0.04, 0.3), 0.1
"""Shortest and longest push, and the time after its end that tells it from a torque that goes on to vary."""


class Times:
    """Changes that begin at given times, and loads that also end, after all steps.

    Parameters
    ----------
    candidates : sequence of Candidate
    steps : sequence of FilterStep
    begins : sequence of Begin
    push_s : (float, float, float)
        Shortest and longest time after which a load ends, and shortest time after that.

    Attributes
    ----------
    begins : (n, 3) array of int
        In the order of steps.
    onset_s : (n,) array
    first, last : (m,) arrays of int
        Places in `begins` of beginning and end of each change; -1: it lasts. The first n are `begins`.
    gradient, information, log_evidence : (m,) arrays
    """

    def __init__(
        self,
        candidates: Sequence[Candidate],
        steps: Sequence[FilterStep],
        begins: Sequence[Begin],
        push_s: tuple[float, float, float] = (*PUSH_s, AFTER_s),
    ) -> None:
        given = np.array(begins, np.int64).reshape(-1, 3)
        self.begins = given[np.argsort(given[:, 1], kind="stable")]
        self._signatures, self._products = Signatures(candidates), np.zeros((0, 0))
        self._end_s = float(steps[-1].block.t_s[-1])
        is_load = np.array([candidate.kind.name == LOADS for candidate in candidates])
        for number, step in enumerate(steps):
            new = self.begins[self.begins[:, 1] == number]
            if len(new) or len(self._signatures):
                signature = self._signatures.advance(step, new[:, 0], new[:, 2])
                loads = signature[:, is_load[self._signatures.candidate]]
                products = product(loads.T, loads)
                products[: len(self._products), : len(self._products)] += self._products
                self._products = products
        self.onset_s, candidate = self._signatures.onset_s, self.begins[:, 0]
        self._load = np.cumsum(is_load[candidate]) - 1  # place among the loads
        pairs = [self._pairs(number, push_s) for number in np.flatnonzero(is_load).tolist()]
        singles = np.arange(len(candidate))
        self.first = np.concatenate([singles, *(first for first, _ in pairs)])
        self.last = np.concatenate([np.full(len(singles), -1), *(last for _, last in pairs)])
        first, last = self.first[len(singles) :], self.last[len(singles) :]
        gradient, information = self._signatures.gradient, self._signatures.information
        shared = self._products[self._load[first], self._load[last]]
        self.gradient = np.append(gradient, gradient[first] - gradient[last])
        self.information = np.append(
            information, np.maximum(information[first] + information[last] - 2 * shared, 1e-300)
        )
        self._candidate = candidate[self.first]
        self.log_evidence = evidence(self.gradient, self.information, candidates, self._candidate)

    def _pairs(self, number: int, push_s: tuple[float, float, float]) -> tuple[Places, Places]:
        """Return beginnings and ends of a load."""
        own = np.flatnonzero(self.begins[:, 0] == number)
        i, j = np.triu_indices(len(own), 1)
        lasted_s = self.onset_s[own[j]] - self.onset_s[own[i]]
        until_s = self._end_s - self.onset_s[own[j]]
        valid = (lasted_s >= push_s[0]) & (lasted_s <= push_s[1]) & (until_s >= push_s[2])
        return own[i[valid]], own[j[valid]]

    def places(self, number: int, *, over: bool) -> Places:
        """Return the places of a candidate among the changes: of those that are over, or of the others."""
        return np.flatnonzero((self._candidate == number) & ((self.last >= 0) == over))

    def errors(self, first: int, last: int) -> Array:
        """Return the errors (6 + p,) that a unit has left in the filter."""
        errors = self._signatures.errors
        return errors[:, first] - (errors[:, last] if last >= 0 else 0.0)

    def products(self, loads: Places) -> Array:
        """Return the inner products of the signatures of loads, by places in `begins`."""
        return self._products[np.ix_(self._load[loads], self._load[loads])]
