"""Every case with every seed, over threads: the order of what is found does not depend on theirs."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.records.summary import figures_of
from spheretwin.twin.reproduce.experiment import Case, Experiment, Outcome, Outcomes
from spheretwin.twin.reproduce.memory import Memory
from spheretwin.twin.reproduce.planning import Plan, plant_of, scenario_of, seeds_of
from spheretwin.twin.simulation import Run, simulate
from spheretwin.twin.study.agreement import Ending, compare
from spheretwin.twin.study.plants import FULL

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
