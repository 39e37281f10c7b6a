"""Runs of an experiment: every case with every seed, a sample of them on both plants, earlier ones cached."""

from __future__ import annotations

import hashlib
import json
import shlex
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import cache
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin import scenario as scenarios
from spheretwin.models import mjcf
from spheretwin.models.actuator import MJCF_PATH, TORQUE_CURVE_PATH
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import versions
from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import Case, Experiment, Outcome, Outcomes
from spheretwin.paper.outcome_cache import OutcomeCache
from spheretwin.provenance import digest
from spheretwin.run import Run, figures_of
from spheretwin.scenario.changes import complete_fields
from spheretwin.scenario.files import FilesCache
from spheretwin.scenario.reading import named_files
from spheretwin.scenario.sections import Scenario
from spheretwin.scenario.writing import command_words
from spheretwin.session import Session
from spheretwin.simulation import run_session
from spheretwin.study.agreement import Ending, compare
from spheretwin.study.engines.threads import run_each
from spheretwin.study.study import FULL, fast_engine
from spheretwin.study.template import Template, are_numbers, template_of

Array = NDArray[np.float64]

PLANT = "plant.engine"

EVERY = 100
"""In addition to the first run of each law, one run in this many runs on MuJoCo too."""


class Job(NamedTuple):
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
    def jobs(self) -> list[Job]:
        """Every case with every seed, from 0 on."""
        return [
            Job(case, plant_of(case, self.plant), seed) for case in self.cases for seed in self._seeds(case)
        ]

    @property
    def sample(self) -> list[Job]:
        """Runs that are repeated on MuJoCo: the first of each law, and some chosen by their names."""
        if self.plant == FULL:
            return []
        jobs: list[Job] = []
        laws: set[Any] = set()
        for case in self.cases:
            if plant_of(case, None) or not case.comparable:
                continue
            law = case.fields.get("controller.law")
            for seed in self._seeds(case):
                lot = zlib.crc32(f"{self.experiment.name} {case.name} {seed}".encode())
                if law not in laws or lot % EVERY == 0:
                    jobs.append(Job(case, FULL, seed))
                laws.add(law)
        return jobs

    def by_case(self, outcomes: Sequence[Outcome]) -> Outcomes:
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
    fields = {**case.fields_of(seed), "seed": seed}
    plant = plant_of(case, default)
    if plant is None:
        section = scenarios.load(case.scenario, fields).plant
        plant = fast_engine(section.mjcf, section.integrator)
    return scenarios.load(case.scenario, {**fields, PLANT: plant})


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


def key_of(scenario: Scenario) -> str:
    """Digest of everything that a run depends on, except plant, seed and sources."""
    fields = scenario.model_dump(mode="json", exclude={"seed": True, "plant": {"engine"}})
    files = {path: digest(dotted, path) for path, dotted in named_files(fields)}
    content = json.dumps([fields, files, _shipped(), versions()], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:32]


@cache
def _shipped() -> tuple[str | None, ...]:
    """Digests of the shipped model and torque curve."""
    return mjcf.contents_digest(MJCF_PATH), digest("plant.torque_curve", str(TORQUE_CURVE_PATH))


class PlanResult(NamedTuple):
    """Outcomes of a plan."""

    plan: Plan
    summaries: Mapping[str, CaseSummary]
    outcomes: Outcomes
    differences: list[float]
    """Differences of the sample that ran on both plants."""


def run_with_cache(
    plan: Plan, summaries: Mapping[str, CaseSummary], done: Callable[[str], None]
) -> PlanResult:
    """Run a plan and its sample; runs in the cache are not run again."""
    cache = OutcomeCache(plan, summaries)
    outcomes = run_plan(plan, done, cache=cache)
    return PlanResult(plan, summaries, outcomes, compare_plants(plan, outcomes, done, cache))


def run_plan(
    plan: Plan,
    done: Callable[[str], None] = lambda case: None,
    threads: int | None = None,
    cache: OutcomeCache | None = None,
) -> Outcomes:
    """Run every case of a plan with every seed.

    Parameters
    ----------
    plan : Plan
    done : callable
        Receives the name of the case after each run.
    threads : int, optional
        Number of cores unless given.
    cache : OutcomeCache, optional
        Earlier runs, which are not run again.

    Raises
    ------
    InputError
        A case cannot be run.
    """
    return plan.by_case(_run(plan, plan.jobs, done, threads, cache))


def compare_plants(
    plan: Plan,
    outcomes: Outcomes,
    done: Callable[[str], None] = lambda case: None,
    cache: OutcomeCache | None = None,
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
    on_mujoco = _run(plan, plan.sample, done, None, cache)
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
    jobs: Sequence[Job],
    done: Callable[[str], None],
    threads: int | None,
    cache: OutcomeCache | None,
) -> list[Outcome]:
    """Return outcomes in the order of the jobs."""
    outcomes = {i: outcome for i, job in enumerate(jobs) if cache and (outcome := cache.find(job))}
    for i in outcomes:
        done(jobs[i].case.name)
    missing = [i for i in range(len(jobs)) if i not in outcomes]
    runs = _Runs()

    def work(i: int) -> Outcome:
        return _outcome(plan.experiment, runs.run(jobs[i]))

    try:
        with closing(run_each(missing, work, threads)) as results:
            for i, outcome in results:
                outcomes[i] = outcome
                if cache:
                    cache.add(jobs[i], outcome)
                done(jobs[i].case.name)
    finally:
        if cache:
            cache.save()
    return [outcomes[i] for i in range(len(jobs))]


class _Runs:
    """Runs of jobs, which read each file once; those of a case differ in numbers alone."""

    def __init__(self) -> None:
        self._files = FilesCache()
        self._templates: dict[tuple[str, str | None], Template | None] = {}

    def run(self, job: Job) -> Run:
        """Run a job."""
        scenario = self._scenario(job)
        with Session(scenario, files=self._files.files_of(scenario)) as session:
            return run_session(session)

    def _scenario(self, job: Job) -> Scenario:
        case, numbers = job.case, {"seed": job.seed, **job.case.seeded_fields(job.seed)}
        if case.single_run or not case.is_random or not are_numbers(numbers.values()):
            return scenario_of(case, job.plant, job.seed)
        shape = case.name, job.plant
        if shape not in self._templates:
            engine = scenario_of(case, job.plant, job.seed).plant.engine
            fields = complete_fields(case.scenario, {**case.fields, **numbers, PLANT: engine})
            self._templates[shape] = template_of(fields, tuple(numbers), case.scenario)
        template = self._templates[shape]
        if template is None:
            return scenario_of(case, job.plant, job.seed)
        return template.scenario(tuple(numbers.values()))


def _outcome(experiment: Experiment, run: Run) -> Outcome:
    error = np.abs(measured_error(run))
    largest = error.max(axis=0) if len(error) else np.full(3, np.nan)
    return Outcome(run.status, figures_of(run), largest, experiment.reduce(run))


def _ending(outcome: Outcome) -> Ending:
    return outcome.status, outcome.figures["rms_error_rad"] or [0.0] * 3


def unexpected_ends(plan: Plan, outcomes: Outcomes) -> list[str]:
    """Cases with a status that they may not have, each with these statuses."""
    ends = {case.name: _unexpected(case, outcomes[case.name]) for case in plan.cases}
    return [f"{name} ({', '.join(statuses)})" for name, statuses in ends.items() if statuses]


def _unexpected(case: Case, outcomes: Sequence[Outcome]) -> list[Status]:
    return sorted({outcome.status for outcome in outcomes} - set(case.expected_statuses))


def measured_error(run: Run) -> Array:
    """Tracking error from the sensors, (n, 3) in rad; the true error if the sensors are ideal."""
    table = run.telemetry
    if "q_measured_rad" in {signal.name for signal in table.signals}:
        return table["q_measured_rad"] - table["q_ref_rad"]
    return table["error_rad"]
