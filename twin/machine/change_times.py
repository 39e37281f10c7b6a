"""Times of changes: candidates that begin, and loads that also end, at given times, with their evidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.machine.change_filter import FilterStep
from spheretwin.machine.explanations import LOADS, Candidate, evidence
from spheretwin.machine.signatures import Places, Signatures
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.matrices import product

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
