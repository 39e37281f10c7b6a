"""What is in force in a session: a scenario, what its files hold, and what its user put in their places."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from spheretwin.control.law import Law
from spheretwin.control.parts.parameters import AROUND
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.record import Change
from spheretwin.models.telemetry.signals import Signal
from spheretwin.twin import assembly, resolving
from spheretwin.twin.scenario.changing import changed
from spheretwin.twin.scenario.files import Files, files_again, files_of
from spheretwin.twin.scenario.sections import ResolvedScenario, Scenario
from spheretwin.twin.trajectories.trajectory import OwnTrajectory, Sampled, checked


class InForce(NamedTuple):
    """All that a machine is built from; a change gives another."""

    scenario: ResolvedScenario
    files: Files
    own_law: Law | None
    own_trajectory: OwnTrajectory | None

    @property
    def law(self) -> Law:
        """Law that is asked for; one that a scenario names is made anew at each call."""
        return self.own_law or assembly.law_of(self.scenario)

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Columns that a run has."""
        return assembly.signals_of(self.scenario, self.files.actuator, self.law)

    def after(self, name: str, value: Any) -> InForce:
        """With another value of one field, or another law.

        Raises
        ------
        InputError
            A field that is unknown, of the wrong type or out of range, or one of what the user replaced.
        """
        if isinstance(value, Law):
            return _resolved(self.scenario, self.files, value, self.own_trajectory)
        if self.own_trajectory and name.split(".")[0] == "trajectory":
            raise InputError(
                "session: expected no field of a scenario's trajectory, as"
                f" {self.own_trajectory.name} is followed instead"
            )
        own_law = None if name == "controller.law" else self.own_law
        of_the_law = name.startswith("controller.") and name.split(".")[1] not in AROUND
        if own_law and of_the_law:
            raise InputError(f"session: expected no field of a shipped law, as {own_law.name} is not one")
        scenario = changed(self.scenario, name, value)
        files = files_again(self.files, self.scenario, scenario)
        return _resolved(scenario, files, own_law, self.own_trajectory)

    def after_each(self, plan: tuple[Change, ...]) -> Iterator[InForce]:
        """After each of some changes in turn.

        Raises
        ------
        InputError
            One of them cannot be made.
        """
        now = self
        for change in plan:
            now = now.after(change.name, change.value)
            yield now


def at_start(
    scenario: Scenario, law: Law | None, trajectory: Sampled | None, files: Files | None = None
) -> InForce:
    """What a session begins with; its files are read unless given.

    Raises
    ------
    InputError
        The model file, the torque curve, the trajectory or a value of the scenario cannot be used.
    """
    own = None if trajectory is None else checked(trajectory)
    return _resolved(scenario, files or files_of(scenario), law, own)


def _resolved(scenario: Scenario, files: Files, law: Law | None, trajectory: OwnTrajectory | None) -> InForce:
    return InForce(resolving.resolved(scenario, files, law, trajectory), files, law, trajectory)
