"""A tuning from its first trial to its table: laws one after the other, trials of a batch side by side."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from spheretwin.models.base.files import make_folder
from spheretwin.models.telemetry import checksums
from spheretwin.study import agreement
from spheretwin.study import optimise as objectives
from spheretwin.study.engines import engine_in_process
from spheretwin.study.engines.threads import run_each
from spheretwin.study.grid import Grid, Row
from spheretwin.study.journal import Journal, digest_of
from spheretwin.study.optimise import Gain, Objective, Optimise
from spheretwin.study.row import Rows
from spheretwin.study.study import Study
from spheretwin.study.tuning import gains, sampler
from spheretwin.study.tuning import trials as trial
from spheretwin.study.tuning.sampler import Proposer, warnings_only
from spheretwin.study.tuning.trials import Ended, FinishedTrial, Tried, values_of

if TYPE_CHECKING:
    from optuna import Trial


class Holdout(NamedTuple):
    """Objectives of gains under seeds that no trial was chosen by.

    Attributes
    ----------
    reason : str
        Reason of a loss; empty without one.
    values : list of float
        Objectives, to be minimised.
    """

    reason: str
    values: list[float]


def hold_out(
    rows: Rows,
    law: Mapping[str, Any] | None,
    optimise: Optimise,
    fields: Mapping[int, Mapping[str, float]],
    stop_requested: Callable[[], bool],
) -> dict[int, Holdout]:
    """Run some trials of a law under as many further seeds as the study says.

    Parameters
    ----------
    rows : Rows
    law : mapping or None
    optimise : Optimise
    fields : mapping
        Value of each field that its gains set, by trial.
    stop_requested : callable

    Returns
    -------
    dict
        By trial; empty without further seeds. Trials that were stopped are absent.
    """
    if not optimise.fresh:
        return {}
    seeds = rows.study.seeds
    longer = Grid(rows.study.model_copy(update={"seeds": seeds + optimise.fresh}))
    conditions = [row for row in longer if row.law == law and row.repeat >= seeds]

    tried = trial.run_trials(
        rows, conditions, list(fields.values()), optimise.objective, lambda _: False, stop_requested
    )
    return {
        number: Holdout(one.reason, one.values if one.ended == Ended.COMPLETED else [])
        for number, one in zip(fields, tried, strict=True)
        if one is not None
    }


NAME, JOURNAL = "trials.parquet", "trials.jsonl"

MOST_TRIALS = 10**7
"""Of all laws: numbers of the journal."""

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
    names = dict.fromkeys(name for _, of_law, _, _ in laws for name in gains.numbers(of_law))
    settings = dict.fromkeys(
        setting.field for _, of_law, _, _ in laws for gain in of_law for setting in gain.settings
    )
    kinds = {
        "law": pa.string(),
        "trial": pa.int64(),
        "ended": pa.string(),
        "reason": pa.string(),
        "best": pa.bool_(),
        "rows": pa.int64(),
        **dict.fromkeys([*names, *settings], pa.float64()),
        **{objective.called: pa.float64() for objective in objectives},
        **{f"{objective.called}, each row": pa.list_(pa.float64()) for objective in objectives},
    }
    records = [
        {
            **_head(law, finished, best),
            **finished.chosen,
            **gains.values(of_law, finished.chosen),
            **_objectives(objectives, finished),
        }
        for law, of_law, trials, best in laws
        for finished in trials
    ]
    metadata = {
        "study": study.model_dump_json(),
        "optimise": optimise.model_dump_json(),
        "scenario": rows.base.model_dump_json(),
    }
    columns = [pa.array([record.get(name) for record in records], type=kind) for name, kind in kinds.items()]
    schema = pa.schema([pa.field(name, kind) for name, kind in kinds.items()], metadata=metadata)
    checksums.write_parquet(path, schema, [pa.table(columns, schema=schema)], compression="zstd")


def _head(law: str, finished: FinishedTrial, best: Sequence[int]) -> dict[str, Any]:
    return {
        "law": law,
        "trial": finished.number,
        "ended": str(finished.tried.ended),
        "reason": finished.tried.reason or None,
        "best": finished.number in best,
        "rows": len(finished.tried.by_row),
    }


def _objectives(objectives: Sequence[Objective], finished: FinishedTrial) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for i, objective in enumerate(objectives):
        lost = finished.tried.ended == Ended.LOST
        fields[objective.called] = None if lost else objective.sign * finished.tried.values[i]
        fields[f"{objective.called}, each row"] = [objective.sign * row[i] for row in finished.tried.by_row]
    return fields


Stop = Callable[[], bool]


class ReportedTrial(NamedTuple):
    """Trial of the report: the start of a law, or one of its best."""

    finished: FinishedTrial
    fields: Mapping[str, float]
    """Value of each field that its gains set."""
    holdout: Holdout | None
    command: str
    """Command line that runs its first row."""


class LawResult(NamedTuple):
    """Trials of one law."""

    law: str
    trials: Sequence[FinishedTrial]
    start: ReportedTrial | None
    """The first trial, if the study defines it."""
    best: Sequence[ReportedTrial]
    """One trial, or the front from the best of the first objective to that of the second."""


class TuningResult(NamedTuple):
    """Result of a tuning.

    Attributes
    ----------
    laws : sequence of LawResult
    trials : int
        Finished, including those of earlier runs.
    of : int
        Requested.
    resumed : int
        Trials of earlier runs.
    wall_s : float
    table : Path
    """

    laws: Sequence[LawResult]
    trials: int
    of: int
    resumed: int
    wall_s: float
    table: Path


def tune(
    study: Study,
    folder: Path,
    *,
    trials: int | None = None,
    engine: str = "local",
    threads: int | None = None,
    done: Callable[[int, int], None] = lambda trials, of: None,
    stop_requested: Stop = lambda: False,
) -> TuningResult:
    """Tune the gains of each law of a study.

    Parameters
    ----------
    study : Study
        With ``[optimise]``.
    folder : Path
        For storage and table. Trials of the same study in it are continued.
    trials : int, optional
        Of each law; the study's unless given. More are the same and some more.
    engine : str
        ``local``, threads of this process, or ``cuda``, a GPU.
    threads : int, optional
        Number of cores unless given; the result does not depend on it.
    done : callable
        Receives the number of finished trials, and of all trials.
    stop_requested : callable
        True ends it when the rows in flight are finished.

    Raises
    ------
    InputError
        The study, the scenario or the folder cannot be used.
    SpheretwinError
        The first row differs between the plants, or a file could not be written; finished trials are stored.
    """
    started = time.perf_counter()
    optimise = gains.section_of(study)
    chosen = engine_in_process(engine, "tuning")
    rows, threads = chosen.prepare(Rows(gains.judged(study))), threads or chosen.threads
    laws = [_Law(study, rows, law) for law in study.law or (None,)]
    gains.check(study, rows, [(law.gains, law.conditions[0]) for law in laws])
    make_folder(folder)
    planned = trials or optimise.planned
    digest = _digest(rows, optimise)
    with warnings_only(), Journal(folder / JOURNAL, digest, MOST_TRIALS) as journal:
        for place, law in enumerate(laws):
            law.open(journal, place, len(laws))
        resumed = sum(len(law.proposer.finished) for law in laws)
        try:
            _fill(laws, planned, threads, done, stop_requested)
        finally:
            trials_of_laws = [(law.called, law.gains, law.trials, law.proposer.best) for law in laws]
            write(folder / NAME, study, rows, trials_of_laws)
        results = [law.result(stop_requested) for law in laws]
    finished = sum(len(result.trials) for result in results)
    return TuningResult(
        laws=results,
        trials=finished,
        of=max(planned * len(laws), finished),
        resumed=resumed,
        wall_s=time.perf_counter() - started,
        table=folder / NAME,
    )


class _Law:
    """Runs trials of one law and stores them."""

    proposer: Proposer
    _journal: Journal

    def __init__(self, study: Study, rows: Rows, law: Mapping[str, Any] | None) -> None:
        self._rows, self._study, self._law = rows, study, law
        self._optimise: Optimise = gains.section_of(study)
        self.called = gains.called(law, rows)
        self.gains: tuple[Gain, ...] = gains.gains_of(study, law, rows)
        self.conditions: list[Row] = [row for row in Grid(rows.study) if row.law == law]

    def open(self, journal: Journal, place: int, laws: int) -> None:
        """Read the trials of the law, which is at a place among the laws, from a journal."""
        self._journal, self._place, self._laws = journal, place, laws
        finished: dict[int, FinishedTrial] = {}
        for stored, (chosen, ended, reason, by_row) in journal.records():
            if stored % laws == place:
                values = values_of(self._optimise.objective, by_row, len(self.conditions))
                tried = Tried(Ended(ended), reason, values, by_row)
                finished[stored // laws] = FinishedTrial(stored // laws, chosen, tried)
        self.proposer = Proposer(self.called, self.gains, self._optimise, self._study.seed, finished)

    @property
    def trials(self) -> list[FinishedTrial]:
        """Finished trials, by number."""
        return [trial for _, trial in sorted(self.proposer.finished.items())]

    def batches(self, planned: int) -> Iterator[list[Trial]]:
        """Propose the trials, some together; yield the unfinished ones of each batch that has any."""
        for first in range(0, planned, self._optimise.together):
            batch = range(first, min(first + self._optimise.together, planned))
            if proposals := self.proposer.propose(batch):
                yield proposals

    def run(
        self,
        proposals: Sequence[Trial],
        threads: int | None,
        stop_requested: Stop,
        report: Callable[[], None],
    ) -> None:
        """Run the unfinished trials of a batch."""
        first = proposals[0].number - proposals[0].number % self._optimise.together
        completed = [
            trial.tried.values
            for trial in self.trials
            if trial.number < first and trial.tried.ended == Ended.COMPLETED
        ]

        def has_lost(values: Sequence[float]) -> bool:
            if not self._optimise.prune:
                return False
            beyond = bool(self._optimise.limits) and values[1] > self._optimise.limits[-1]
            return beyond or any(objectives.dominates(better, values) for better in completed)

        def run(share: Sequence[Trial]) -> list[Tried | None]:
            fields = [gains.values(self.gains, proposal.params) for proposal in share]
            return trial.run_trials(
                self._rows, self.conditions, fields, self._optimise.objective, has_lost, stop_requested
            )

        count = threads or os.cpu_count() or 1
        shares = [share for first in range(count) if (share := proposals[first::count])]
        with closing(run_each(shares, run, count)) as results:
            for share, ends in results:
                for proposal, tried in zip(share, ends, strict=True):
                    if tried is not None:
                        record = [proposal.params, tried.ended, tried.reason, tried.by_row]
                        self._journal.append(self._laws * proposal.number + self._place, record)
                        self.proposer.tell(proposal, tried)
                        report()

    def result(self, stop_requested: Stop) -> LawResult:
        """Result of the law: its start and its best, with their holdout."""
        finished = self.proposer.finished
        has_start = gains.start_of(self.gains) is not None and 0 in finished
        numbers = dict.fromkeys([*([0] if has_start else []), *self.proposer.best])
        fields = {number: gains.values(self.gains, finished[number].chosen) for number in numbers}
        holdouts = hold_out(self._rows, self._law, self._optimise, fields, stop_requested)
        reported = {
            number: ReportedTrial(
                finished[number],
                fields[number],
                holdouts.get(number),
                self._rows.command(trial.with_fields(self.conditions[0], fields[number])),
            )
            for number in numbers
        }
        best = [reported[number] for number in self.proposer.best]
        return LawResult(self.called, self.trials, reported[0] if has_start else None, best)

    def check_plant(self) -> None:
        """Compare the fast plant with MuJoCo on the first row with the gains of the start."""
        middle = gains.middle(self.gains)
        row = trial.with_fields(self.conditions[0], gains.values(self.gains, middle))
        if agreement.has_both(self._rows, row):
            list(agreement.check(self._rows, [row]))


def _fill(
    laws: Sequence[_Law], planned: int, threads: int | None, done: Callable[[int, int], None], stop: Stop
) -> None:
    """Run the missing trials."""
    total = planned * len(laws)
    finished = sum(min(len(law.proposer.finished), planned) for law in laws)
    done(finished, total)

    def report() -> None:
        nonlocal finished
        finished += 1
        done(finished, total)

    for law in laws:
        for i, proposals in enumerate(law.batches(planned)):
            if stop():
                return
            if i == 0:
                law.check_plant()
            law.run(proposals, threads, stop, report)


def _digest(rows: Rows, optimise: Optimise) -> str:
    """Digest of everything that a trial depends on, without the number of trials and the holdout."""
    section = optimise.model_dump(mode="json", exclude={"trials", "fresh"})
    content = json.dumps([digest_of(rows), section, sampler.optuna().__version__], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()
