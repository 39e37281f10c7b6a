"""What is to be run of an experiment: its cases, on which plant, under how many seeds."""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import shlex
import time
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin import scenario as scenarios
from spheretwin.models import mjcf
from spheretwin.models.actuator import MJCF_PATH, TORQUE_CURVE_PATH
from spheretwin.models.base.cache import load_entry, store_entry
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import versions
from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import Case, Experiment, Outcome, Outcomes
from spheretwin.provenance import digest
from spheretwin.run import Run, figures_of
from spheretwin.scenario.reading import named_files
from spheretwin.scenario.sections import Scenario
from spheretwin.simulation import simulate
from spheretwin.study.agreement import Ending, compare
from spheretwin.study.study import FULL, fast_engine

EVERY_s = 30.0
"""What a killed process loses at most."""


class Memory:
    """Outcomes of an experiment's runs by their keys; told to by one thread, asked by any.

    Parameters
    ----------
    name : str
        Of the experiment, which keeps things of its own of each run.
    keys : mapping
        `key_of` of each case, by its name.
    """

    def __init__(self, name: str, keys: Mapping[str, str]) -> None:
        self._keys = keys
        self._entry = f"reproduce_{name}.pickle"
        content = load_entry(self._entry)
        # What lies there beside it is machine code: the folder is trusted.
        self._outcomes: dict[str, Outcome] = pickle.loads(content) if content else {}
        self._saved_s, self._new = time.monotonic(), 0

    def find(self, case: str, plant: str | None, seed: int) -> Outcome | None:
        """Outcome of an earlier run; None where there was none."""
        return self._outcomes.get(self._key(case, plant, seed))

    def add(self, case: str, plant: str | None, seed: int, outcome: Outcome) -> None:
        """Take an outcome, and save all now and then."""
        self._outcomes[self._key(case, plant, seed)] = outcome
        self._new += 1
        if time.monotonic() - self._saved_s > EVERY_s:
            self.save()

    def save(self) -> None:
        """Save what is new, unless the cache cannot take it."""
        if self._new:
            store_entry(self._entry, pickle.dumps(self._outcomes))
            self._saved_s, self._new = time.monotonic(), 0

    def _key(self, case: str, plant: str | None, seed: int) -> str:
        return f"{self._keys[case]} {plant} {seed}"


def key_of(scenario: Scenario) -> str:
    """What tells a scenario from any other but for plant and seed, as long as the sources are the same."""
    fields = scenario.model_dump(mode="json", exclude={"seed": True, "plant": {"engine"}})
    files = {path: digest(dotted, path) for path, dotted in named_files(fields)}
    told = json.dumps([fields, files, _shipped(), versions()], sort_keys=True)
    return hashlib.sha256(told.encode()).hexdigest()[:32]


@cache
def _shipped() -> tuple[str | None, ...]:
    """Digests of the model and the curve that are used where no other is named."""
    return mjcf.contents_digest(MJCF_PATH), digest("plant.torque_curve", str(TORQUE_CURVE_PATH))


PLANT = "plant.engine"


class Plan(NamedTuple):
    """What is to be run of an experiment."""

    experiment: Experiment
    cases: list[Case]
    seeds: int
    plant: str | None = None
    """Of the cases that leave it open; the fast one where the model allows it, unless given."""

    @property
    def runs(self) -> int:
        """How many there are."""
        return sum(seeds_of(case, self.seeds) for case in self.cases)


class Known(NamedTuple):
    """What is known of a case before its runs."""

    key: str
    """Of its scenario, whatever plant and seed."""
    scenario: str
    plant: str
    law: str
    m: float
    L: float
    hardware: str


def planned(experiment: Experiment, seeds: int, limit: int | None = None, plant: str | None = None) -> Plan:
    """Plan of an experiment: all of its cases, or the first `limit` of them."""
    return Plan(experiment, experiment.cases()[:limit], seeds, plant)


def seeds_of(case: Case, seeds: int) -> int:
    """Runs of a case."""
    return seeds if case.draws and not case.once else 1


def plant_of(case: Case, wanted: str | None) -> str | None:
    """Plant of a case: its own, or else the wanted one; None for the fast one where the model allows it."""
    named: str | None = case.fields.get(PLANT, wanted)
    return named


def scenario_of(case: Case, wanted: str | None, seed: int = 0) -> Scenario:
    """Scenario of a run.

    Parameters
    ----------
    case : Case
    wanted : str, optional
        Plant of a case that does not name its own; the fast one where the model allows it, unless given.
    seed : int

    Raises
    ------
    InputError
        Its fields make no scenario.
    """
    fields = {**case.fields_of(seed), "seed": seed}
    plant = plant_of(case, wanted)
    if plant is None:
        section = scenarios.load(case.scenario, fields).plant
        plant = fast_engine(section.mjcf, section.integrator)
    return scenarios.load(case.scenario, {**fields, PLANT: plant})


def known(plan: Plan) -> dict[str, Known]:
    """What is known of each case, by its name, before any is run.

    Raises
    ------
    InputError
        A case's fields make no scenario, as under a law that has not what the case varies.
    """
    return {case.name: _known(plan, case) for case in plan.cases}


def _known(plan: Plan, case: Case) -> Known:
    try:
        scenario = scenario_of(case, plan.plant)
    except InputError as error:
        raise InputError(f"reproduce {plan.experiment.name}, {case.name}: {error}") from None
    return Known(
        key=key_of(scenario),
        scenario=scenario.name,
        plant=scenario.plant.engine,
        law=scenario.controller.law,
        m=scenario.plant.modelling_error,
        L=scenario.disturbance.load,
        hardware=scenario.hardware,
    )


def command_line(case: Case, plant: str, seed: int = 0) -> str:
    """Command that runs a case alone, under one seed."""
    words = ["spheretwin", "simulate", case.scenario]
    for dotted, value in {**case.fields_of(seed), PLANT: plant, "seed": seed}.items():
        for flag, texts in _flags(dotted, value):
            words += [f"--{flag.replace('_', '-')}", *texts]
    return shlex.join(words)


def _flags(dotted: str, value: Any) -> Iterator[tuple[str, list[str]]]:
    """Flags of a value: a list of tables has one for each field of each."""
    if isinstance(value, Mapping):
        for name, inside in value.items():
            yield from _flags(f"{dotted}.{name}", inside)
    elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
        for place, inside in enumerate(value):
            yield from _flags(f"{dotted}.{place}", inside)
    elif isinstance(value, list | tuple):
        yield dotted, [json.dumps(each) for each in value]
    else:
        yield dotted, [value if isinstance(value, str) else json.dumps(value)]


Array = NDArray[np.float64]


EVERY = 100
"""Beside the first run of each law, one in so many runs on MuJoCo too."""


def carried_out(
    plan: Plan,
    done: Callable[[str], None] = lambda case: None,
    workers: int | None = None,
    memory: Memory | None = None,
) -> Outcomes:
    """Run every case of a plan with every seed, from 0 on.

    Parameters
    ----------
    plan : Plan
    done : callable
        Told the name of its case after each run.
    workers : int, optional
        Threads; as many as there are cores unless given. The loop holds no lock of the interpreter.
    memory : Memory, optional
        Of earlier runs, which are not run again; all are run unless given.

    Raises
    ------
    InputError
        A case cannot be run.
    """
    jobs = [
        Job(case, plant_of(case, plan.plant), seed)
        for case in plan.cases
        for seed in range(seeds_of(case, plan.seeds))
    ]
    found = _over_threads(plan, jobs, done, workers, memory)
    by_case: dict[str, list[Outcome]] = {case.name: [] for case in plan.cases}
    for job, outcome in zip(jobs, found, strict=True):
        by_case[job.case.name].append(outcome)
    return by_case


class Job(NamedTuple):
    """One run."""

    case: Case
    plant: str | None
    """The fast one where the model allows it, if None."""
    seed: int

    @property
    def name(self) -> str:
        """For complaints."""
        return f"{self.case.name}, seed {self.seed}"


def checked(
    plan: Plan,
    outcomes: Outcomes,
    done: Callable[[str], None] = lambda case: None,
    memory: Memory | None = None,
) -> list[float]:
    """Run a sample of what ran on the Lagrangian on MuJoCo too, and hold them against each other.

    Returns
    -------
    list of float
        How far each of the sample is apart, as `study.agreement` says; none of a run that was lost.

    Raises
    ------
    SpheretwinError
        One is not the same on both plants.
    """
    jobs = sample(plan)
    theirs = _over_threads(plan, jobs, done, None, memory)
    return [
        compare(
            f"reproduce {plan.experiment.name}: expected {job.name}",
            _ending(outcomes[job.case.name][job.seed]),
            _ending(other),
            "--plant mujoco runs all on MuJoCo alone",
        )
        for job, other in zip(jobs, theirs, strict=True)
    ]


def sample(plan: Plan) -> list[Job]:
    """Runs that are to be made on MuJoCo too: the first of each law, and some at random, but for ever."""
    if plan.plant == FULL:
        return []
    chosen: list[Job] = []
    laws: set[Any] = set()
    for case in plan.cases:
        if plant_of(case, None) or not case.compared:  # a plant of its own, or of no other
            continue
        law = case.fields.get("controller.law")
        for seed in range(seeds_of(case, plan.seeds)):
            if law not in laws or _lot(plan, case, seed) % EVERY == 0:
                chosen.append(Job(case, FULL, seed))
            laws.add(law)
    return chosen


def _lot(plan: Plan, case: Case, seed: int) -> int:
    return zlib.crc32(f"{plan.experiment.name} {case.name} {seed}".encode())


def _ending(outcome: Outcome) -> Ending:
    return outcome.status, outcome.figures["rms_error_rad"] or [0.0] * 3


def _over_threads(
    plan: Plan,
    jobs: Sequence[Job],
    done: Callable[[str], None],
    workers: int | None,
    memory: Memory | None,
) -> list[Outcome]:
    """Outcomes in the order of the jobs, whatever that of the threads."""
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        futures = {pool.submit(_outcome, plan.experiment, job, memory): job for job in jobs}
        try:
            for future in as_completed(futures):
                outcome, is_new = future.result()
                job = futures[future]
                if memory and is_new:
                    memory.add(job.case.name, job.plant, job.seed, outcome)
                done(job.case.name)
        except BaseException:  # a case that cannot be run, or Ctrl-C: the others are not waited for
            pool.shutdown(cancel_futures=True)
            raise
        finally:
            if memory:
                memory.save()
    return [future.result()[0] for future in futures]


def failed(plan: Plan, outcomes: Outcomes) -> list[str]:
    """Cases of which a run ended as it should not, each with how."""
    ends = {case.name: _unwanted(case, outcomes[case.name]) for case in plan.cases}
    return [f"{name} ({', '.join(statuses)})" for name, statuses in ends.items() if statuses]


def _unwanted(case: Case, outcomes: Sequence[Outcome]) -> list[Status]:
    return sorted({outcome.status for outcome in outcomes} - set(case.ends))


def _outcome(experiment: Experiment, job: Job, memory: Memory | None) -> tuple[Outcome, bool]:
    """Outcome of a run, and whether it was made now."""
    if memory and (found := memory.find(job.case.name, job.plant, job.seed)):
        return found, False
    run = simulate(scenario_of(job.case, job.plant, job.seed))
    return Outcome(run.status, figures_of(run), _measured_largest(run), experiment.keep(run)), True


def _measured_largest(run: Run) -> Array:
    error = np.abs(measured_error(run))
    return error.max(axis=0) if len(error) else np.full(3, np.nan)


def measured_error(run: Run) -> Array:
    """Tracking error as the sensors tell it, (n, 3) in rad; the true one where they tell the truth."""
    table = run.telemetry
    if "q_measured_rad" in {signal.name for signal in table.signals}:
        return table["q_measured_rad"] - table["q_ref_rad"]
    return table["error_rad"]
