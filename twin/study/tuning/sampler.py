"""What is tried next: Optuna's samplers, each trial with a stream of its own, so that any run proposes alike.

The samplers of a trial are made anew from the study's seed and the trial's number, and see the trials of
earlier batches and what its own batch asked for before it. Nothing else of the process goes into a proposal:
neither threads nor an interruption change it, a SIGKILL in the middle of a proposal included.
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
    """Storage in a file, made or gone on with; Optuna says nothing meanwhile but what is wrong.

    Raises
    ------
    InputError
        Another process writes it, or it is none.
    SpheretwinError
        It could not be written, as on a full disk; what was written before is kept.
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


class _Held:
    """A lock for Optuna, which takes and gives it back at each line: the process has one for all of them."""

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
        return journal.JournalStorage(journal.JournalFileBackend(str(path), cast(Any, _Held())))
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

DIGEST, EACH, REASON = "digest", "each", "reason"


class Proposer:
    """Trials of one law: proposed, told of and kept.

    Parameters
    ----------
    storage : BaseStorage
    law : str
        By which its trials are kept.
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
        The trials that are there are those of another study.
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
            "minimize" if each.direction == "minimise" else "maximize" for each in optimise.objective
        ]
        if law in {each.study_name for each in storage.get_all_studies()}:
            self._study = self._optuna.load_study(study_name=law, storage=storage)
        else:
            self._study = self._optuna.create_study(study_name=law, storage=storage, directions=directions)
        trials = self._study.get_trials(deepcopy=False)
        found = self._study.user_attrs.get(DIGEST)
        if found is None and not trials:
            self._study.set_user_attr(DIGEST, digest)
        elif found != digest:
            raise InputError(
                f"study: expected trials of this study with these sources and versions for {law},"
                " received those of others; remove them, or write into another folder"
            )
        start = start_of(gains)
        if start is not None and not trials:
            self._study.enqueue_trial(start)

    @property
    def kept(self) -> list[FinishedTrial]:
        """Finished trials, by number."""
        trials = self._study.get_trials(deepcopy=False)
        return [self._of(trial) for trial in trials if trial.state.is_finished()]

    @property
    def best(self) -> list[int]:
        """Numbers of the best trial, of the best within each limit, or of the front."""
        kept = {each.number: each.tried.values for each in self.kept if each.tried.ended == Ended.COMPLETED}
        if len(self._optimise.objective) == 1:
            return sorted(kept, key=lambda number: (kept[number], number))[:1]
        if limits := self._optimise.limits:
            within = [objectives.best_within(kept, limit) for limit in limits]
            return list(dict.fromkeys(each for each in within if each is not None))
        front: list[int] = []
        for number in sorted(kept, key=lambda number: (kept[number], number)):
            if not front or kept[number][1] < kept[front[-1]][1]:  # none before it is worse in the first
                front.append(number)
        return front

    def propose(self, number: int) -> Trial:
        """Trial of a number, as it was proposed where it has been; numbers one after the other."""
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
            # Of its own for each gain: those that a killed process had drawn already are not drawn again.
            self._study.sampler = self._sampler(number, name)
            trial.suggest_float(name, low, high, log=is_log)
        return trial

    def tell(self, trial: Trial, tried: Tried) -> None:
        """Keep what a trial gave."""
        # What a killed process had told already is the same, and Optuna warns of a second time.
        before: FrozenTrial = self._study.get_trials(deepcopy=False)[trial.number]
        state = self._optuna.trial.TrialState
        trial.set_user_attr(EACH, tried.each)
        if tried.ended == Ended.LOST:
            trial.set_user_attr(REASON, tried.reason)
            if not before.constraints:  # known as worse than any that completes
                trial.set_constraint("completed", 1.0)
        can_report = len(self._optimise.objective) == 1 and not before.intermediate_values
        if tried.ended == Ended.PRUNED and can_report:  # Optuna takes no reports of two objectives
            trial.report(self._signed(tried.values)[0], len(tried.each))
        if tried.ended == Ended.COMPLETED:
            self._study.tell(trial, self._signed(tried.values))
        else:
            self._study.tell(trial, state=state.PRUNED)

    def _local(self, number: int) -> dict[str, float]:
        first = number - number % self._optimise.together
        earlier = [each for each in self.kept if each.number < first]
        return proposed(self._gains, self._optimise, f"{self._seed} {self._law}", number, earlier)

    def _signed(self, values: Sequence[float]) -> list[float]:
        return [each.sign * value for each, value in zip(self._optimise.objective, values, strict=True)]

    def _of(self, trial: FrozenTrial) -> FinishedTrial:
        attributes: dict[str, Any] = trial.user_attrs
        each = attributes.get(EACH, [])
        values = [
            objectives.of_rows(objective, [row[place] for row in each], self._rows)
            for place, objective in enumerate(self._optimise.objective)
        ]
        reason = attributes.get(REASON, "" if EACH in attributes else "told of by another program")
        completed = trial.state == self._optuna.trial.TrialState.COMPLETE
        ended = Ended.LOST if reason else Ended.COMPLETED if completed else Ended.PRUNED
        return FinishedTrial(trial.number, trial.params, Tried(ended, reason, values, each))

    def _sampler(self, number: int, gain: str = "") -> BaseSampler:
        digest = hashlib.sha256(f"{self._seed} {self._law} {number} {gain}".encode()).digest()
        seed = int.from_bytes(digest[:4], "big")
        samplers = self._optuna.samplers
        if self._optimise.sampler == "nsga2":
            return samplers.NSGAIISampler(population_size=POPULATION, seed=seed)
        if self._optimise.sampler in ("random", "local"):
            return samplers.RandomSampler(seed=seed)
        return samplers.TPESampler(seed=seed)
