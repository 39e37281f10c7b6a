"""A tuning from its first trial to its table: laws one after the other, trials of a batch side by side."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any, NamedTuple

from spheretwin.models.base.files import make_folder
from spheretwin.models.telemetry import checksums
from spheretwin.study import agreement
from spheretwin.study import optimise as objectives
from spheretwin.study.grid import Grid, Row
from spheretwin.study.journal import digest_of
from spheretwin.study.optimise import Gain, Objective, Optimise
from spheretwin.study.row import Rows
from spheretwin.study.study import Study
from spheretwin.study.tuning import gains, sampler
from spheretwin.study.tuning import trials as trial
from spheretwin.study.tuning.sampler import Proposer
from spheretwin.study.tuning.trials import Ended, FinishedTrial


class Fresh(NamedTuple):
    """What gains give under fresh seeds.

    Attributes
    ----------
    reason : str
        Why they lost; empty where they did not.
    values : list of float
        Objectives, to be minimised.
    """

    reason: str
    values: list[float]


def fresh(
    rows: Rows,
    law: Mapping[str, Any] | None,
    optimise: Optimise,
    fields: Mapping[int, Mapping[str, float]],
    threads: int | None,
    stop_requested: Callable[[], bool],
) -> dict[int, Fresh]:
    """Run some trials of a law under as many further seeds as the study says.

    Parameters
    ----------
    rows : Rows
    law : mapping or None
    optimise : Optimise
    fields : mapping
        Value of each field that its gains set, by trial.
    threads : int, optional
    stop_requested : callable

    Returns
    -------
    dict
        By trial; empty without fresh seeds, and without those that were stopped on the way.
    """
    if not optimise.fresh:
        return {}
    seeds = rows.study.seeds
    longer = Grid(rows.study.model_copy(update={"seeds": seeds + optimise.fresh}))
    conditions = [row for row in longer if row.law == law and row.repeat >= seeds]

    def judged(number: int) -> Fresh | None:
        tried = trial.run_trial(
            rows, conditions, fields[number], optimise.objective, lambda _: False, stop_requested
        )
        if tried is None:
            return None
        return Fresh(tried.reason, tried.values if tried.ended == Ended.COMPLETED else [])

    with ThreadPoolExecutor(threads or os.cpu_count(), thread_name_prefix="fresh") as pool:
        found = zip(fields, pool.map(judged, fields), strict=True)
        return {number: each for number, each in found if each is not None}


NAME = "trials.parquet"

LawTrials = tuple[str, Sequence[Gain], Sequence[FinishedTrial], Sequence[int]]
"""Name of a law, its gains, its trials, numbers of the best."""


def write(path: Path, study: Study, rows: Rows, laws: Sequence[LawTrials]) -> None:
    """Write all finished trials, law by law, whole or not at all.

    An objective stands under its name, its values of each row under the same name with ``, each row``. A
    pruned trial has what its objectives are at least, or at most where they are to be large.

    Raises
    ------
    SpheretwinError
        It could not be written; what was there before is untouched.
    """
    import pyarrow as pa  # slow to import

    optimise = gains.section_of(study)
    objectives = optimise.objective
    names = dict.fromkeys(each for _, of_law, _, _ in laws for each in gains.numbers(of_law))
    settings = dict.fromkeys(
        each.field for _, of_law, _, _ in laws for gain in of_law for each in gain.settings
    )
    kinds = {
        "law": pa.string(),
        "trial": pa.int64(),
        "ended": pa.string(),
        "reason": pa.string(),
        "best": pa.bool_(),
        "rows": pa.int64(),
        **dict.fromkeys([*names, *settings], pa.float64()),
        **{each.called: pa.float64() for each in objectives},
        **{f"{each.called}, each row": pa.list_(pa.float64()) for each in objectives},
    }
    records = [
        {
            **_head(law, each, best),
            **each.chosen,
            **gains.values(of_law, each.chosen),
            **_trial_summary(objectives, each),
        }
        for law, of_law, kept, best in laws
        for each in kept
    ]
    metadata = {
        "study": study.model_dump_json(),
        "optimise": optimise.model_dump_json(),
        "scenario": rows.base.model_dump_json(),
    }
    columns = [pa.array([each.get(name) for each in records], type=kind) for name, kind in kinds.items()]
    schema = pa.schema([pa.field(name, kind) for name, kind in kinds.items()], metadata=metadata)
    checksums.write_parquet(path, schema, [pa.table(columns, schema=schema)], compression="zstd")


def _head(law: str, kept: FinishedTrial, best: Sequence[int]) -> dict[str, Any]:
    return {
        "law": law,
        "trial": kept.number,
        "ended": str(kept.tried.ended),
        "reason": kept.tried.reason or None,
        "best": kept.number in best,
        "rows": len(kept.tried.each),
    }


def _trial_summary(objectives: Sequence[Objective], kept: FinishedTrial) -> dict[str, Any]:
    told: dict[str, Any] = {}
    for place, objective in enumerate(objectives):
        lost = kept.tried.ended == Ended.LOST
        told[objective.called] = None if lost else objective.sign * kept.tried.values[place]
        told[f"{objective.called}, each row"] = [objective.sign * each[place] for each in kept.tried.each]
    return told


Stop = Callable[[], bool]


class Chosen(NamedTuple):
    """A trial that is told of."""

    kept: FinishedTrial
    fields: Mapping[str, float]
    """Value of each field that its gains set."""
    fresh: Fresh | None
    """What it gives under seeds that no trial was chosen by."""
    command: str
    """Command line that runs its first row."""


class OfLaw(NamedTuple):
    """What was found of one law."""

    law: str
    kept: Sequence[FinishedTrial]
    start: Chosen | None
    """The first trial, where the study says what it is."""
    best: Sequence[Chosen]
    """One trial, or the front from the best of the first objective to that of the second."""


class Found(NamedTuple):
    """What a tuning left.

    Attributes
    ----------
    laws : sequence of OfLaw
    trials : int
        Finished, those of earlier runs included.
    of : int
        Wanted.
    resumed : int
        Trials that were there already.
    wall_s : float
    table : Path
    """

    laws: Sequence[OfLaw]
    trials: int
    of: int
    resumed: int
    wall_s: float
    table: Path


def tuned(
    study: Study,
    folder: Path,
    *,
    trials: int | None = None,
    threads: int | None = None,
    done: Callable[[int, int], None] = lambda trials, of: None,
    stop_requested: Stop = lambda: False,
) -> Found:
    """Look for the gains of each law of a study.

    Parameters
    ----------
    study : Study
        With ``[optimise]``.
    folder : Path
        For storage and table. Where trials of the same study are there already, it goes on behind them.
    trials : int, optional
        Of each law; the study's unless given. More are the same and some more, where the number before was a
        multiple of those proposed together.
    threads : int, optional
        As many as there are cores unless given; what is found does not depend on it.
    done : callable
        Told of the trials that are finished, and of how many there are.
    stop_requested : callable
        True ends it when the rows in flight are finished.

    Raises
    ------
    InputError
        The study, the scenario or the folder cannot be used.
    SpheretwinError
        The first row differs between the plants, or a file could not be written; what is finished is kept.
    """
    started = time.perf_counter()
    optimise = gains.section_of(study)
    rows = Rows(gains.judged(study))
    laws = [_Law(study, rows, law) for law in study.law or (None,)]
    gains.check(study, rows, [(each.gains, each.conditions[0]) for each in laws])
    make_folder(folder)
    wanted = trials or optimise.planned
    with sampler.opened(folder / sampler.NAME) as kept:
        digest = _digest(rows, optimise)
        for law in laws:
            law.proposer = Proposer(
                kept, law.called, digest, law.gains, optimise, study.seed, len(law.conditions)
            )
        resumed = sum(len(law.proposer.kept) for law in laws)
        try:
            _fill(laws, wanted, threads, done, stop_requested)
        finally:
            found = [(law.called, law.gains, law.proposer.kept, law.proposer.best) for law in laws]
            write(folder / NAME, study, rows, found)
        told = [law.found(threads, stop_requested) for law in laws]
    return Found(
        laws=told,
        trials=sum(len(law.kept) for law in told),
        of=max(wanted * len(laws), sum(len(law.kept) for law in told)),
        resumed=resumed,
        wall_s=time.perf_counter() - started,
        table=folder / NAME,
    )


class _Law:
    """Runs trials of one law."""

    proposer: Proposer

    def __init__(self, study: Study, rows: Rows, law: Mapping[str, Any] | None) -> None:
        self._rows, self._study, self._law = rows, study, law
        self._optimise: Optimise = gains.section_of(study)
        self.called = gains.called(law, rows)
        self.gains: tuple[Gain, ...] = gains.gains_of(study, law, rows)
        self.conditions: list[Row] = [row for row in Grid(rows.study) if row.law == law]

    def batches(self, wanted: int) -> Iterator[range]:
        """Numbers of the trials that are proposed together and not all finished."""
        finished = {each.number for each in self.proposer.kept}
        for first in range(0, wanted, self._optimise.together):
            batch = range(first, min(first + self._optimise.together, wanted))
            if not finished.issuperset(batch):
                yield batch

    def run(
        self, batch: range, pool: ThreadPoolExecutor, stop_requested: Stop, told: Callable[[], None]
    ) -> None:
        """Run what is not finished of a batch."""
        kept = self.proposer.kept
        finished = {each.number for each in kept}
        before = [
            each.tried.values
            for each in kept
            if each.number < batch.start and each.tried.ended == Ended.COMPLETED
        ]

        def has_lost(values: Sequence[float]) -> bool:
            if not self._optimise.prune:
                return False
            beyond = bool(self._optimise.limits) and values[1] > self._optimise.limits[-1]
            return beyond or any(objectives.dominates(each, values) for each in before)

        proposed = [self.proposer.propose(number) for number in batch if number not in finished]
        flying = {
            pool.submit(
                trial.run_trial,
                self._rows,
                self.conditions,
                gains.values(self.gains, each.params),
                self._optimise.objective,
                has_lost,
                stop_requested,
            ): each
            for each in proposed
        }
        try:
            for future in as_completed(flying):
                tried = future.result()
                if tried is not None:
                    self.proposer.tell(flying[future], tried)
                    told()
        finally:
            for future in flying:
                future.cancel()

    def found(self, threads: int | None, stop_requested: Stop) -> OfLaw:
        """What is told of the law: its start and its best, under fresh seeds too."""
        kept = {each.number: each for each in self.proposer.kept}
        has_start = gains.start_of(self.gains) is not None and 0 in kept
        numbers = dict.fromkeys([*([0] if has_start else []), *self.proposer.best])
        fields = {number: gains.values(self.gains, kept[number].chosen) for number in numbers}
        judged = fresh(self._rows, self._law, self._optimise, fields, threads, stop_requested)
        chosen = {
            number: Chosen(
                kept[number],
                fields[number],
                judged.get(number),
                self._rows.command(trial.with_fields(self.conditions[0], fields[number])),
            )
            for number in numbers
        }
        best = [chosen[number] for number in self.proposer.best]
        return OfLaw(self.called, list(kept.values()), chosen[0] if has_start else None, best)

    def check_plant(self) -> None:
        """Hold the fast plant against MuJoCo: the first row, as it starts."""
        middle = gains.middle(self.gains)
        row = trial.with_fields(self.conditions[0], gains.values(self.gains, middle))
        agreement.check(self._rows, row)


def _fill(
    laws: Sequence[_Law], wanted: int, threads: int | None, done: Callable[[int, int], None], stop: Stop
) -> None:
    """Run the trials that are not there yet."""
    of = wanted * len(laws)
    finished = sum(min(len(law.proposer.kept), wanted) for law in laws)
    done(finished, of)

    def told() -> None:
        nonlocal finished
        finished += 1
        done(finished, of)

    with ThreadPoolExecutor(threads or os.cpu_count(), thread_name_prefix="trial") as pool:
        for law in laws:
            for place, batch in enumerate(law.batches(wanted)):
                if stop():
                    return
                if place == 0:
                    law.check_plant()
                law.run(batch, pool, stop, told)


def _digest(rows: Rows, optimise: Optimise) -> str:
    """Digest of all that a trial depends on; how many there are, and how they are told of, is none of it."""
    section = optimise.model_dump(mode="json", exclude={"trials", "fresh"})
    told = json.dumps([digest_of(rows), section, sampler.optuna().__version__], sort_keys=True)
    return hashlib.sha256(told.encode()).hexdigest()
