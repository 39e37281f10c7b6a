"""Proposals of trials by Optuna's samplers, each trial with a random stream of its own.

The samplers of a trial are created from the study's seed and the trial's number. They receive the trials of
earlier batches and the earlier proposals of the same batch. A proposal depends on nothing else: neither on
threads nor on an interruption, a SIGKILL during a proposal included.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from spheretwin.models.base.errors import InputError, SpheretwinError, without_breaks
from spheretwin.study import optimise as objectives
from spheretwin.study.journal import lock
from spheretwin.study.optimise import Gain, Optimise
from spheretwin.study.tuning.gains import numbers, start_of
from spheretwin.study.tuning.local_search import proposed
from spheretwin.study.tuning.trials import Ended, FinishedTrial, Tried

if TYPE_CHECKING:
    from optuna.storages import BaseStorage

NAME = "trials.jsonl"


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
        raise InputError(
            "study: expected the extra `spheretwin[tune]` to look for gains,"
            " received an installation without optuna"
        ) from None
    return optuna


@contextmanager
def opened(path: Path) -> Iterator[BaseStorage]:
    """Storage in a file, new or continued; Optuna logs warnings alone.

    Raises
    ------
    InputError
        Another process writes it, or it is none.
    SpheretwinError
        It could not be written, as on a full disk; earlier trials are stored.
    """
    module = optuna()
    verbosity = module.logging.get_verbosity()
    module.logging.set_verbosity(module.logging.WARNING)
    try:
        with _locked(path) as file:
            _drop_torn_line(file, path)
            yield _read(module, path)
    except OSError as error:
        raise SpheretwinError(
            f"study: {path} could not be written, {error.strerror or error}; the trials before are kept"
        ) from None
    finally:
        module.logging.set_verbosity(verbosity)


class _NoLock:
    """Lock of Optuna, which acquires and releases it at each line: the process holds one for all lines."""

    def acquire(self) -> bool:
        return True

    def release(self) -> None:
        pass


@contextmanager
def _locked(path: Path) -> Iterator[BinaryIO]:
    try:
        file = path.open("r+b" if path.exists() else "x+b")
    except OSError as error:
        raise InputError(f"study: expected a folder for its trials, {without_breaks(error)}") from None
    with file:
        try:
            lock(file)
        except OSError:
            raise InputError(
                f"study: expected one process at a time, received {path}, which another one writes"
            ) from None
        yield file


def _drop_torn_line(file: BinaryIO, path: Path) -> None:
    content = file.read()
    whole = content[: content.rfind(b"\n") + 1]
    try:
        if whole:  # Optuna finds any line but the last one itself
            json.loads(whole[whole[:-1].rfind(b"\n") + 1 :])
    except ValueError as error:
        raise _no_trials(path, error) from None
    file.truncate(len(whole))


def _read(module: ModuleType, path: Path) -> BaseStorage:
    journal = module.storages.journal
    try:
        return journal.JournalStorage(journal.JournalFileBackend(str(path), cast(Any, _NoLock())))
    except OSError:
        raise
    except Exception as error:  # whatever its parser meets in a file that is none of its own
        raise _no_trials(path, error) from None


def _no_trials(path: Path, error: Exception) -> InputError:
    return InputError(
        f"study: expected trials of Optuna, received {path} ({type(error).__name__});"
        " remove it, or write into another folder"
    )


if TYPE_CHECKING:
    from optuna import Trial
    from optuna.samplers import BaseSampler
    from optuna.storages import BaseStorage
    from optuna.trial import FrozenTrial

# Of NSGA-II: some generations have to fit into as many trials as are usual here.
POPULATION = 20

DIGEST, BY_ROW, REASON = "digest", "each", "reason"


class Proposer:
    """Trials of one law in the storage of Optuna.

    Parameters
    ----------
    storage : BaseStorage
    law : str
        Name under which its trials are stored.
    digest : str
        Of all that its results depend on.
    gains : sequence of Gain
    optimise : Optimise
    seed : int
    rows : int
        Of each trial.

    Raises
    ------
    InputError
        The stored trials are those of another study.
    """

    def __init__(
        self,
        storage: BaseStorage,
        law: str,
        digest: str,
        gains: Sequence[Gain],
        optimise: Optimise,
        seed: int,
        rows: int,
    ) -> None:
        self._optuna = optuna()
        self._law, self._gains, self._optimise, self._seed, self._rows = law, gains, optimise, seed, rows
        self._storage = storage
        directions = [
            "minimize" if objective.direction == "minimise" else "maximize"
            for objective in optimise.objective
        ]
        if law in {existing.study_name for existing in storage.get_all_studies()}:
            self._study = self._optuna.load_study(study_name=law, storage=storage)
        else:
            self._study = self._optuna.create_study(study_name=law, storage=storage, directions=directions)
        trials = self._study.get_trials(deepcopy=False)
        stored = self._study.user_attrs.get(DIGEST)
        if stored is None and not trials:
            self._study.set_user_attr(DIGEST, digest)
        elif stored != digest:
            raise InputError(
                f"study: expected trials of this study with these sources and versions for {law},"
                " received those of others; remove them, or write into another folder"
            )
        start = start_of(gains)
        if start is not None and not trials:
            self._study.enqueue_trial(start)

    @property
    def finished(self) -> list[FinishedTrial]:
        """Finished trials, by number."""
        trials = self._study.get_trials(deepcopy=False)
        return [self._of(trial) for trial in trials if trial.state.is_finished()]

    @property
    def best(self) -> list[int]:
        """Numbers of the best trial, of the best within each limit, or of the front."""
        completed = {
            trial.number: trial.tried.values
            for trial in self.finished
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

    def propose(self, number: int) -> Trial:
        """Trial of a number; an earlier proposal of it is repeated. Numbers are proposed in order."""
        self._study.sampler = self._sampler(number)
        trials = self._study.get_trials(deepcopy=False)
        waiting = self._optuna.trial.TrialState.WAITING
        if number < len(trials) and trials[number].state != waiting:
            study_id = self._storage.get_study_id_from_name(self._law)
            trial_id = self._storage.get_trial_id_from_study_id_trial_number(study_id, number)
            trial = self._optuna.trial.Trial(self._study, trial_id)
        else:
            if self._optimise.sampler == "local" and number >= len(trials):
                self._study.enqueue_trial(self._local(number))
            trial = self._study.ask()
        for name, (low, high, is_log) in numbers(self._gains).items():
            # A sampler for each gain: gains that a killed process proposed are not proposed again.
            self._study.sampler = self._sampler(number, name)
            trial.suggest_float(name, low, high, log=is_log)
        return trial

    def tell(self, trial: Trial, tried: Tried) -> None:
        """Store the result of a trial."""
        # A killed process may have stored a part of it, and Optuna warns of a second time.
        before: FrozenTrial = self._study.get_trials(deepcopy=False)[trial.number]
        state = self._optuna.trial.TrialState
        trial.set_user_attr(BY_ROW, tried.by_row)
        if tried.ended == Ended.LOST:
            trial.set_user_attr(REASON, tried.reason)
            if not before.constraints:  # known as worse than any that completes
                trial.set_constraint("completed", 1.0)
        can_report = len(self._optimise.objective) == 1 and not before.intermediate_values
        if tried.ended == Ended.PRUNED and can_report:  # Optuna takes no reports of two objectives
            trial.report(self._signed(tried.values)[0], len(tried.by_row))
        if tried.ended == Ended.COMPLETED:
            self._study.tell(trial, self._signed(tried.values))
        else:
            self._study.tell(trial, state=state.PRUNED)

    def _local(self, number: int) -> dict[str, float]:
        first = number - number % self._optimise.together
        earlier = [trial for trial in self.finished if trial.number < first]
        return proposed(self._gains, self._optimise, f"{self._seed} {self._law}", number, earlier)

    def _signed(self, values: Sequence[float]) -> list[float]:
        signs = [objective.sign for objective in self._optimise.objective]
        return [sign * value for sign, value in zip(signs, values, strict=True)]

    def _of(self, trial: FrozenTrial) -> FinishedTrial:
        attributes: dict[str, Any] = trial.user_attrs
        by_row = attributes.get(BY_ROW, [])
        values = [
            objectives.of_rows(objective, [row[i] for row in by_row], self._rows)
            for i, objective in enumerate(self._optimise.objective)
        ]
        reason = attributes.get(REASON, "" if BY_ROW in attributes else "told of by another program")
        completed = trial.state == self._optuna.trial.TrialState.COMPLETE
        ended = Ended.LOST if reason else Ended.COMPLETED if completed else Ended.PRUNED
        return FinishedTrial(trial.number, trial.params, Tried(ended, reason, values, by_row))

    def _sampler(self, number: int, gain: str = "") -> BaseSampler:
        digest = hashlib.sha256(f"{self._seed} {self._law} {number} {gain}".encode()).digest()
        seed = int.from_bytes(digest[:4], "big")
        samplers = self._optuna.samplers
        if self._optimise.sampler == "nsga2":
            return samplers.NSGAIISampler(population_size=POPULATION, seed=seed)
        if self._optimise.sampler in ("random", "local"):
            return samplers.RandomSampler(seed=seed)
        return samplers.TPESampler(seed=seed)
