"""Runs of an experiment: every case with every seed, a sample of them on both plants, earlier ones cached."""

from __future__ import annotations

import shlex
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import cache
from itertools import islice
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from pydantic import TypeAdapter

from spheretwin.metrics.user_metrics import UserMetric
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.status import Status
from spheretwin.paper.earlier_runs import EarlierRuns, key_of
from spheretwin.paper.experiment import STATUSES, Case, Experiment, Outcomes, RunOutcome
from spheretwin.run import Run
from spheretwin.scenario.sections import Scenario
from spheretwin.scenario.writing import command_words
from spheretwin.study.agreement import Ending, compare
from spheretwin.study.engines.threads import run_each
from spheretwin.study.grid import Row
from spheretwin.study.row import RowResult, Rows
from spheretwin.study.study import FULL, Study

PLANT = "plant.engine"

EVERY = 100
"""In addition to the first run of each law, one run in this many runs on MuJoCo too."""


class CaseRun(NamedTuple):
    """One run."""

    case: Case
    plant: str | None
    """None for the fast plant if the model allows it."""
    seed: int

    @property
    def name(self) -> str:
        """Case and seed, for messages."""
        return f"{self.case.name}, seed {self.seed}"


class Plan(NamedTuple):
    """Cases of an experiment that are run."""

    experiment: Experiment
    cases: list[Case]
    seeds: int | None = None
    """Runs of each case; those of `Case.seeds` unless given."""
    plant: str | None = None
    """Plant of the cases that do not name one; the fast one if the model allows it, unless given."""

    @property
    def jobs(self) -> list[CaseRun]:
        """Every case with every seed, from 0 on."""
        return [
            CaseRun(case, plant_of(case, self.plant), seed)
            for case in self.cases
            for seed in self._seeds(case)
        ]

    @property
    def sample(self) -> list[CaseRun]:
        """Runs that are repeated on MuJoCo: the first of each law, and some chosen by their names."""
        if self.plant == FULL:
            return []
        jobs: list[CaseRun] = []
        laws: set[Any] = set()
        for case in self.cases:
            if plant_of(case, None) or not case.comparable:
                continue
            law = case.fields.get("controller.law")
            for seed in self._seeds(case):
                lot = zlib.crc32(f"{self.experiment.name} {case.name} {seed}".encode())
                if law not in laws or lot % EVERY == 0:
                    jobs.append(CaseRun(case, FULL, seed))
                laws.add(law)
        return jobs

    def by_case(self, outcomes: Sequence[RunOutcome]) -> Outcomes:
        """Return the outcomes of `jobs` by the name of the case."""
        remaining = iter(outcomes)
        return Outcomes({case.name: list(islice(remaining, len(self._seeds(case)))) for case in self.cases})

    def _seeds(self, case: Case) -> range:
        return range((self.seeds or case.seeds) if case.is_random and not case.single_run else 1)


def make_plan(
    experiment: Experiment, seeds: int | None = None, limit: int | None = None, plant: str | None = None
) -> Plan:
    """Plan of an experiment: all of its cases, or the first `limit` of them."""
    return Plan(experiment, experiment.cases()[:limit], seeds, plant)


def plant_of(case: Case, default: str | None) -> str | None:
    """Return the plant of a case, or the default if it names none."""
    plant: str | None = case.fields.get(PLANT, default)
    return plant


MEASURED, DATA = "measured_max_abs_error_rad", "data"
"""Figures of a run in addition to the metrics."""


def figures_of(experiment: Experiment) -> Mapping[str, UserMetric]:
    """Return the functions of a run by the names of their figures, in addition to the metrics."""
    return {MEASURED: measured_max_abs_error, DATA: experiment.reduce}


@cache
def rows_of(experiment: Experiment | None, scenario: str) -> Rows:
    """Return what runs the rows of an experiment that have a scenario."""
    own = figures_of(experiment) if experiment else {}
    return Rows(Study(name="reproduce", scenario=scenario), own=own)


def _row(case: Case, seed: int) -> Row:
    return Row(seed, f"{case.name} {seed}", seed, case.fields_of(seed), None, seed)


def scenario_of(case: Case, default: str | None, seed: int = 0) -> Scenario:
    """Scenario of a run.

    Parameters
    ----------
    case : Case
    default : str, optional
        Plant of a case that does not name one; the fast one if the model allows it, unless given.
    seed : int

    Raises
    ------
    InputError
        Its fields make no scenario.
    """
    return rows_of(None, case.scenario).scenario(_row(case, seed), _engine(case, default))


def _engine(case: Case, default: str | None) -> str | None:
    return None if PLANT in case.fields else default


def command_line(case: Case, plant: str, seed: int = 0) -> str:
    """Command that runs a case alone, with one seed."""
    return shlex.join(command_words(case.scenario, {**case.fields_of(seed), PLANT: plant, "seed": seed}))


class CaseSummary(NamedTuple):
    """Description of a case before its runs."""

    key: str
    """`key_of` its scenario."""
    fields: Mapping[str, Any]
    """Scenario, law, condition, hardware and plant, for its row of the JSON."""


def summarise(plan: Plan) -> dict[str, CaseSummary]:
    """Summary of each case by its name.

    Raises
    ------
    InputError
        The fields of a case make no scenario.
    """
    return {case.name: _summary(plan, case) for case in plan.cases}


def _summary(plan: Plan, case: Case) -> CaseSummary:
    try:
        scenario = scenario_of(case, plan.plant)
    except InputError as error:
        raise InputError(f"reproduce {plan.experiment.name}, {case.name}: {error}") from None
    fields = {
        "scenario": scenario.name,
        "controller": scenario.controller.law,
        "m": scenario.plant.modelling_error,
        "L": scenario.disturbance.load,
        "hardware": scenario.hardware,
        "plant": scenario.plant.engine,
    }
    return CaseSummary(key_of(scenario), fields)


class PlanResult(NamedTuple):
    """Outcomes of a plan."""

    plan: Plan
    summaries: Mapping[str, CaseSummary]
    outcomes: Outcomes
    differences: list[float]
    """Differences of the sample that ran on both plants."""


def earlier_runs(plan: Plan, summaries: Mapping[str, CaseSummary]) -> EarlierRuns:
    """Return the results of earlier runs of a plan."""
    keys = {name: summary.key for name, summary in summaries.items()}
    return EarlierRuns(plan.experiment.name, keys)


def run_with_cache(
    plan: Plan, summaries: Mapping[str, CaseSummary], done: Callable[[str], None]
) -> PlanResult:
    """Run a plan and its sample; runs in the cache are not run again."""
    with earlier_runs(plan, summaries) as earlier:
        outcomes = run_plan(plan, done, earlier=earlier)
        return PlanResult(plan, summaries, outcomes, compare_plants(plan, outcomes, done, earlier))


def run_plan(
    plan: Plan,
    done: Callable[[str], None] = lambda case: None,
    threads: int | None = None,
    earlier: EarlierRuns | None = None,
) -> Outcomes:
    """Run every case of a plan with every seed.

    Parameters
    ----------
    plan : Plan
    done : callable
        Receives the name of the case after each run.
    threads : int, optional
        Number of cores unless given.
    earlier : EarlierRuns, optional
        Their results are not computed again.

    Raises
    ------
    SpheretwinError
        A case cannot be run, or a reduction failed.
    """
    return plan.by_case(_run(plan, plan.jobs, done, threads, earlier))


def compare_plants(
    plan: Plan,
    outcomes: Outcomes,
    done: Callable[[str], None] = lambda case: None,
    earlier: EarlierRuns | None = None,
) -> list[float]:
    """Run the sample of a plan on MuJoCo and compare it with the runs on the Lagrangian.

    Returns
    -------
    list of float
        Difference of each run of the sample, as in `study.agreement`.

    Raises
    ------
    SpheretwinError
        A run differs between the plants.
    """
    on_mujoco = _run(plan, plan.sample, done, None, earlier)
    return [
        compare(
            f"reproduce {plan.experiment.name}: expected {job.name}",
            _ending(outcomes[job.case.name][job.seed]),
            _ending(outcome),
            "--plant mujoco runs all on MuJoCo alone",
        )
        for job, outcome in zip(plan.sample, on_mujoco, strict=True)
    ]


def _run(
    plan: Plan,
    jobs: Sequence[CaseRun],
    done: Callable[[str], None],
    threads: int | None,
    earlier: EarlierRuns | None,
) -> list[RunOutcome]:
    """Return outcomes in the order of the jobs."""
    experiment = plan.experiment
    results = {i: result for i, job in enumerate(jobs) if earlier and (result := earlier.find(job))}
    for i in results:
        done(jobs[i].case.name)
    missing = [i for i in range(len(jobs)) if i not in results]

    def work(i: int) -> RowResult:
        case, plant, seed = jobs[i]
        (result,) = rows_of(experiment, case.scenario).run([_row(case, seed)], _engine(case, plant))
        return result

    with closing(run_each(missing, work, threads)) as running:
        for i, result in running:
            if result.error is not None:
                raise InputError(f"reproduce {experiment.name}, {jobs[i].name}: {result.error}")
            results[i] = result
            if earlier:
                earlier.add(jobs[i], result)
            done(jobs[i].case.name)
    return [outcome_of(experiment, results[i]) for i in range(len(jobs))]


def outcome_of(experiment: Experiment, result: RowResult) -> RunOutcome:
    """Outcome of a run from its result in JSON types."""
    figures = dict(result.figures)
    measured = np.array(figures.pop(MEASURED), np.float64)
    data = _data_type(experiment.reduce).validate_python(figures.pop(DATA))
    return RunOutcome(STATUSES[result.status], figures, measured, data)


@cache
def _data_type(reduce: Callable[[Run], Any]) -> TypeAdapter[Any]:
    return TypeAdapter(get_type_hints(reduce, include_extras=True).get("return", Any))


def _ending(outcome: RunOutcome) -> Ending:
    return outcome.status, outcome.figures["rms_error_rad"] or [0.0] * 3


def unexpected_ends(plan: Plan, outcomes: Outcomes) -> list[str]:
    """Cases with a status that they may not have, each with these statuses."""
    ends = {case.name: _unexpected(case, outcomes[case.name]) for case in plan.cases}
    return [f"{name} ({', '.join(statuses)})" for name, statuses in ends.items() if statuses]


def _unexpected(case: Case, outcomes: Sequence[RunOutcome]) -> list[Status]:
    return sorted({outcome.status for outcome in outcomes} - set(case.expected_statuses))


def measured_max_abs_error(run: Run) -> Array:
    """Largest error from the sensors, (3,) in rad; NaN if the run ended before its first tick was over."""
    error = np.abs(measured_error(run))
    return error.max(axis=0) if len(error) else np.full(3, np.nan)


def measured_error(run: Run) -> Array:
    """Tracking error from the sensors, (n, 3) in rad; the true error if the sensors are ideal."""
    table = run.telemetry
    if "q_measured_rad" in {signal.name for signal in table.signals}:
        return table["q_measured_rad"] - table["q_ref_rad"]
    return table["error_rad"]
