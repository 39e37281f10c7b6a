"""Local search: points of a Sobol sequence, then perturbations of the best trial within each limit in turn.

The budget of a law is that of every other: as many points, as many perturbations, whatever its gains are.
Every number of a trial is a coordinate from 0 to 1 over its range, on a logarithmic scale where its gain is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spheretwin.study import optimise as objectives
from spheretwin.study.optimise import Gain, Optimise
from spheretwin.study.tuning.gains import numbers
from spheretwin.study.tuning.trials import Ended, FinishedTrial

Array = NDArray[np.float64]

MOVED = 0.5
"""Probability that a perturbation moves a coordinate; one is always moved."""

SWITCHED = 0.1
"""Probability that it turns an optional gain on or off."""

WIDEST, NARROWEST = 0.2, 0.02
"""Standard deviation of the first and of the last perturbations, as a share of the range."""


def proposed(
    gains: Sequence[Gain],
    optimise: Optimise,
    key: str,
    number: int,
    earlier: Sequence[FinishedTrial],
) -> dict[str, float]:
    """Values of a trial by name.

    Parameters
    ----------
    gains : sequence of Gain
    optimise : Optimise
    key : str
        Seed and law, which determine the random numbers together with the number of the trial.
    number : int
        Number of the trial, from 0 on.
    earlier : sequence of FinishedTrial
        Trials of earlier batches.
    """
    ranges = numbers(gains)
    if number < optimise.draws:
        point = _sobol(len(ranges), optimise.draws, _generator(key))[number]
    else:
        start = _start(optimise, number, earlier)
        generator = _generator(f"{key} {number}")
        if start is None:
            point = generator.random(len(ranges))
        else:
            progress = min((number - optimise.draws) / (optimise.planned - optimise.draws), 1)
            step = WIDEST * (NARROWEST / WIDEST) ** progress
            switches = np.array([name not in {gain.called for gain in gains} for name in ranges])
            point = _perturbed(_point(ranges, start.chosen), switches, step, generator)
    return {
        name: _value(place, *of) for (name, of), place in zip(ranges.items(), point.tolist(), strict=True)
    }


def _start(optimise: Optimise, number: int, earlier: Sequence[FinishedTrial]) -> FinishedTrial | None:
    """Trial that is perturbed: the best within the limit of this trial, or the nearest to that limit."""
    by_number = {trial.number: trial for trial in earlier}
    completed = {
        trial.number: trial.tried.values for trial in earlier if trial.tried.ended == Ended.COMPLETED
    }
    if not optimise.limits:
        best = min(completed, key=lambda trial: (completed[trial], trial), default=None)
    else:
        turn = (number - optimise.draws) % len(optimise.limits)
        best = objectives.best_within(completed, optimise.limits[turn])
        if best is None:
            near = [trial for trial in earlier if trial.tried.ended != Ended.LOST]
            best = min((trial.tried.values[1], trial.number) for trial in near)[1] if near else None
    return None if best is None else by_number[best]


def _perturbed(
    point: Array, switches: NDArray[np.bool_], step: float, generator: np.random.Generator
) -> Array:
    moved = generator.random(len(point)) < MOVED
    moved[generator.integers(len(point))] = True
    # Reflected at the ends of the range, so that no more trials are at an end than elsewhere.
    changed = np.abs(point + moved * step * generator.standard_normal(len(point)))
    changed = 1 - np.abs(1 - changed % 2)
    redrawn = generator.random(len(point)) < SWITCHED
    return np.where(switches, np.where(redrawn, 1 - point, point), changed)


def _point(ranges: Mapping[str, tuple[float, float, bool]], chosen: Mapping[str, float]) -> Array:
    return np.array([_place(chosen[name], *of) for name, of in ranges.items()])


def _place(value: float, low: float, high: float, is_log: bool) -> float:
    if is_log:
        return float(np.log(value / low) / np.log(high / low))
    return (value - low) / (high - low)


def _value(place: float, low: float, high: float, is_log: bool) -> float:
    value = low * (high / low) ** place if is_log else low + (high - low) * place
    return min(max(value, low), high)


def _sobol(dimensions: int, points: int, generator: np.random.Generator) -> Array:
    from scipy.stats import qmc  # slow to import

    # A power of two of points is generated.
    return qmc.Sobol(dimensions, rng=generator).random_base2((points - 1).bit_length())[:points]


def _generator(key: str) -> np.random.Generator:
    return np.random.default_rng(int.from_bytes(hashlib.sha256(key.encode()).digest()[:8], "big"))
