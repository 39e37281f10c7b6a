"""Every case with every seed, over threads: the order of what is found does not depend on theirs."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Status
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.records.summary import figures_of
from spheretwin.twin.reproduce.experiment import Case, Experiment, Outcome, Outcomes
from spheretwin.twin.simulation import Run, simulate

Array = NDArray[np.float64]


class Plan(NamedTuple):
    """What is to be run of an experiment."""

    experiment: Experiment
    cases: list[Case]
    seeds: int

    @property
    def runs(self) -> int:
        """How many there are."""
        return sum(seeds_of(case, self.seeds) for case in self.cases)


def planned(experiment: Experiment, seeds: int, limit: int | None = None) -> Plan:
    """Plan of an experiment: all of its cases, or the first `limit` of them."""
    return Plan(experiment, experiment.cases()[:limit], seeds)


def seeds_of(case: Case, seeds: int) -> int:
    """Runs of a case."""
    return seeds if case.draws and not case.once else 1


def carried_out(
    plan: Plan, done: Callable[[str], None] = lambda case: None, workers: int | None = None
) -> Outcomes:
    """Run every case of a plan with every seed, from 0 on.

    Parameters
    ----------
    plan : Plan
    done : callable
        Told the name of its case after each run.
    workers : int, optional
        Threads; as many as there are cores unless given. The loop holds no lock of the interpreter.

    Raises
    ------
    InputError
        A case cannot be run.
    """
    jobs = [(case, seed) for case in plan.cases for seed in range(seeds_of(case, plan.seeds))]
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        futures = {pool.submit(_outcome, plan.experiment, *job): job for job in jobs}
        try:
            for future in as_completed(futures):
                future.result()
                done(futures[future][0].name)
        except BaseException:  # a case that cannot be run, or Ctrl-C: the others are not waited for
            pool.shutdown(cancel_futures=True)
            raise
    found: dict[str, list[Outcome]] = {case.name: [] for case in plan.cases}
    for future, (case, _) in futures.items():
        found[case.name].append(future.result())
    return found


def failed(plan: Plan, outcomes: Outcomes) -> list[str]:
    """Cases of which a run ended as it should not, each with how."""
    ends = {case.name: _unwanted(case, outcomes[case.name]) for case in plan.cases}
    return [f"{name} ({', '.join(statuses)})" for name, statuses in ends.items() if statuses]


def _unwanted(case: Case, outcomes: Sequence[Outcome]) -> list[Status]:
    return sorted({outcome.status for outcome in outcomes} - set(case.ends))


def _outcome(experiment: Experiment, case: Case, seed: int) -> Outcome:
    run = simulate(scenarios.load(case.scenario, {**case.fields, "seed": seed}))
    return Outcome(run.status, figures_of(run), _measured_largest(run), experiment.keep(run))


def _measured_largest(run: Run) -> Array:
    error = np.abs(measured_error(run))
    return error.max(axis=0) if len(error) else np.full(3, np.nan)


def measured_error(run: Run) -> Array:
    """Tracking error as the sensors tell it, (n, 3) in rad; the true one where they tell the truth."""
    table = run.telemetry
    if "q_measured_rad" in {signal.name for signal in table.signals}:
        return table["q_measured_rad"] - table["q_ref_rad"]
    return table["error_rad"]
