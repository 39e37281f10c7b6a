"""Currents in the coils from those of a log: held or interpolated, delayed, and with the lag of the drive."""

from __future__ import annotations

from math import exp

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined


@inlined
def mean_currents(
    sample_s: Array,
    sample_A: Array,
    edge_s: Array,
    delay_s: float,
    lag_s: Array,
    interpolated: bool,
    present_A: Array,
    mean_A: Array,
) -> None:
    """Write the mean current of each group in each interval.

    Before the first sample the current is that of the first, after the last one that of the last. With a
    lag τ the current obeys ``τ di/dt = u - i``, so ``∫ i = ∫ u - τ (i_end - i_start)``.

    Parameters
    ----------
    sample_s : (m,) array, s
        Times of the samples, ascending.
    sample_A : (m, groups) array, A
        Samples.
    edge_s : (n + 1,) array, s
        Ends of the intervals, ascending.
    delay_s : float, s
        From a sample to its effect; negative if the clock of the samples is late.
    lag_s : (groups,) array, s
        Time constant of each group; 0 for none.
    interpolated : bool
        True if the current changes linearly from sample to sample, false if it is held.
    present_A : (groups,) array, A
        Current at the first edge; changed to that at the last. Used with a lag alone.
    mean_A : (n, groups) array, A
        Result.
    """
    last, place = sample_s.shape[0] - 1, 0
    for k in range(mean_A.shape[0]):
        start, end = edge_s[k], edge_s[k + 1]
        for j in range(mean_A.shape[1]):
            mean_A[k, j] = 0.0
        at = start
        while at < end:
            while place < last and sample_s[place + 1] + delay_s <= at:
                place += 1
            until = min(end, sample_s[place + 1] + delay_s) if place < last else end
            if sample_s[place] + delay_s > at:  # before the first sample
                until = min(end, sample_s[place] + delay_s)
            _add_piece(
                sample_s,
                sample_A,
                place,
                at - delay_s,
                until - delay_s,
                lag_s,
                interpolated,
                present_A,
                mean_A[k],
            )
            at = until
        for j in range(mean_A.shape[1]):
            mean_A[k, j] /= end - start


@inlined
def _add_piece(
    sample_s: Array,
    sample_A: Array,
    place: int,
    start: float,
    end: float,
    lag_s: Array,
    interpolated: bool,
    present_A: Array,
    sum_As: Array,
) -> None:
    """Add the charge of a time between two samples."""
    length, last = end - start, sample_s.shape[0] - 1
    slopes = interpolated and place < last and start >= sample_s[place]
    share = 0.0
    if slopes:
        share = (0.5 * (start + end) - sample_s[place]) / (sample_s[place + 1] - sample_s[place])
    for j in range(sum_As.shape[0]):
        current = sample_A[place, j]
        if slopes:
            current += share * (sample_A[place + 1, j] - current)
        sum_As[j] += current * length
        if lag_s[j] > 0.0:
            reached = current + (present_A[j] - current) * exp(-length / lag_s[j])
            sum_As[j] -= lag_s[j] * (reached - present_A[j])
            present_A[j] = reached
