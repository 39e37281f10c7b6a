"""What is to be run of an experiment: its cases, on which plant, under how many seeds."""

from __future__ import annotations

from typing import NamedTuple

from spheretwin.models.base.errors import InputError
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.reproduce.experiment import Case, Experiment
from spheretwin.twin.reproduce.memory import key_of
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.study.plants import fast_engine

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
