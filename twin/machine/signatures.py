"""Signatures of changes: what a unit of each, from some time on, leaves in the residuals of the filter.

A change by δ gives the residuals the mean δ s. The signature s follows from the filter: it contains what the
filter takes for an error of the state (Willsky and Jones 1976). So a change is not lost when the estimate
adopts it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.machine.change_filter import FilterStep, LinearBlock, remembered
from spheretwin.machine.explanations import Candidate
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
