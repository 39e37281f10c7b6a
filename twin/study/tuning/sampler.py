"""Proposals of trials by Optuna's samplers, each trial with a random stream of its own.

The samplers of a trial are created from the study's seed and the trial's number. They receive the trials of
earlier batches and the earlier proposals of the same batch. A proposal depends on nothing else: neither on
threads nor on an interruption. Optuna has all of it in memory; the journal has the finished trials.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.extras import missing
from spheretwin.study import optimise as objectives
from spheretwin.study.optimise import Gain, Optimise
from spheretwin.study.tuning.gains import numbers, start_of
from spheretwin.study.tuning.trials import Ended, FinishedTrial, Tried

if TYPE_CHECKING:
    from optuna import Trial
    from optuna.samplers import BaseSampler


# Of NSGA-II: some generations have to fit into as many trials as are usual here.
POPULATION = 20


def optuna() -> ModuleType:
    """Optuna, which is slow to import and no part of what every user has.

    Raises
    ------
    InputError
        It is not installed.
    """
    try:
        import optuna
    except ImportError:
        raise missing("study", "optuna", "tune", "to look for gains") from None
    return optuna


@contextmanager
def warnings_only() -> Iterator[None]:
    """Let Optuna log warnings alone."""
    logging = optuna().logging
    verbosity = logging.get_verbosity()
    logging.set_verbosity(logging.WARNING)
    try:
        yield
    finally:
        logging.set_verbosity(verbosity)


class Proposer:
    """Trials of one law in an Optuna study.

    Parameters
    ----------
    law : str
        Its name is part of the seeds.
    gains : sequence of Gain
    optimise : Optimise
    seed : int
    finished : mapping of int to FinishedTrial
        Trials of earlier runs by number.

    Attributes
    ----------
    finished : dict of int to FinishedTrial
        All finished trials by number.
    """

    def __init__(
        self,
        law: str,
        gains: Sequence[Gain],
        optimise: Optimise,
        seed: int,
        finished: Mapping[int, FinishedTrial],
    ) -> None:
        self._optuna = optuna()
        self._law, self._gains, self._optimise, self._seed = law, gains, optimise, seed
        self.finished = dict(finished)
        directions = ["minimize" if objective.sign > 0 else "maximize" for objective in optimise.objective]
        self._study = self._optuna.create_study(directions=directions)

    @property
    def best(self) -> list[int]:
        """Numbers of the best trial, of the best within each limit, or of the front."""
        completed = {
            number: trial.tried.values
            for number, trial in sorted(self.finished.items())
            if trial.tried.ended == Ended.COMPLETED
        }
        if len(self._optimise.objective) == 1:
            return sorted(completed, key=lambda number: (completed[number], number))[:1]
        if limits := self._optimise.limits:
            within = [objectives.best_within(completed, limit) for limit in limits]
            return list(dict.fromkeys(number for number in within if number is not None))
        front: list[int] = []
        for number in sorted(completed, key=lambda number: (completed[number], number)):
            if (
                not front or completed[number][1] < completed[front[-1]][1]
            ):  # none before it is worse in the first
                front.append(number)
        return front

    def propose(self, batch: range) -> list[Trial]:
        """Return the unfinished trials of a batch; batches are proposed in order, from the first on.

        All trials of the batch are proposed before the result of a finished one is known to the samplers.
        """
        trials = [self._propose(number) for number in batch]
        for trial in trials:
            if trial.number in self.finished:
                self._tell(trial, self.finished[trial.number].tried)
        return [trial for trial in trials if trial.number not in self.finished]

    def tell(self, trial: Trial, tried: Tried) -> None:
        """Take the result of a trial."""
        self.finished[trial.number] = FinishedTrial(trial.number, trial.params, tried)
        self._tell(trial, tried)

    def _propose(self, number: int) -> Trial:
        if fixed := self._fixed(number):
            self._study.enqueue_trial(fixed)
        self._study.sampler = self._sampler(number)
        trial = self._study.ask()
        for name, (low, high, is_log) in numbers(self._gains).items():
            # A sampler for each gain: a gain that is known takes nothing from the random stream of the next.
            self._study.sampler = self._sampler(number, name)
            trial.suggest_float(name, low, high, log=is_log)
        return trial

    def _fixed(self, number: int) -> Mapping[str, float] | None:
        """Return the gains of a trial that no sampler of Optuna chooses, as far as they are known."""
        if number in self.finished:
            return self.finished[number].chosen
        if number == 0 and (start := start_of(self._gains)):
            return start
        if self._optimise.sampler != "local":
            return None
        first = number - number % self._optimise.together
        earlier = [trial for _, trial in sorted(self.finished.items()) if trial.number < first]
        return proposed(self._gains, self._optimise, f"{self._seed} {self._law}", number, earlier)

    def _tell(self, trial: Trial, tried: Tried) -> None:
        signs = [objective.sign for objective in self._optimise.objective]
        values = [sign * value for sign, value in zip(signs, tried.values, strict=True)]
        if tried.ended == Ended.LOST:
            trial.set_constraint("completed", 1.0)  # known as worse than any that completes
        if tried.ended == Ended.PRUNED and len(values) == 1:  # Optuna takes no reports of two objectives
            trial.report(values[0], len(tried.by_row))
        if tried.ended == Ended.COMPLETED:
            self._study.tell(trial, values)
        else:
            self._study.tell(trial, state=self._optuna.trial.TrialState.PRUNED)

    def _sampler(self, number: int, gain: str = "") -> BaseSampler:
        digest = hashlib.sha256(f"{self._seed} {self._law} {number} {gain}".encode()).digest()
        seed = int.from_bytes(digest[:4], "big")
        samplers = self._optuna.samplers
        if self._optimise.sampler == "nsga2":
            return samplers.NSGAIISampler(population_size=POPULATION, seed=seed)
        if self._optimise.sampler in ("random", "local"):
            return samplers.RandomSampler(seed=seed)
        return samplers.TPESampler(seed=seed)


MOVED = 0.5
"""Probability that a perturbation moves a coordinate; one is always moved."""

SWITCHED = 0.1
"""Probability that it turns an optional gain on or off."""

WIDEST, NARROWEST = 0.2, 0.02
"""Standard deviation of the first and of the last perturbations, as a share of the range."""


def proposed(
    gains: Sequence[Gain], optimise: Optimise, key: str, number: int, earlier: Sequence[FinishedTrial]
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
