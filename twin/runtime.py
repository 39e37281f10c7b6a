"""The parts of one twin at work: built from a scenario, built anew where it changes, kept and restored."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin import assembly
from spheretwin import loop as loops
from spheretwin import shared_buffers as wiring
from spheretwin.control.allocation import ALLOCATIONS
from spheretwin.control.applied_torque import transfer_applied_torque
from spheretwin.control.compensators import transfer_compensators
from spheretwin.control.controller import Supervision
from spheretwin.control.law import Law
from spheretwin.control.supervision.watchdog import REASONS, Reason, transfer_watchdog
from spheretwin.electronics import drive as drivings
from spheretwin.electronics import sensors as senses
from spheretwin.loop import is_own, matching
from spheretwin.models.base.compiled import (
    callback_errors,
    check_length,
    for_types_of,
    restore_state,
    save_state,
    transfer_state,
)
from spheretwin.models.base.errors import LawError
from spheretwin.models.telemetry.signals import width
from spheretwin.plant.rotor import Rotor
from spheretwin.scenario.files import Files
from spheretwin.scenario.sections import ResolvedScenario

# For their types alone.
NO_INPUTS = loops.Inputs(
    np.empty(0), np.empty((0, 3, 3)), np.empty((0, 3)), np.empty((0, 0)), np.empty((0, 0))
)


class Last(NamedTuple):
    """The last tick, as far as what begins to be held needs it; nothing in it before the first."""

    q: NDArray[np.float64]  # (3,) rad
    noise: NDArray[np.float64]  # (k,) of the sensors
    command: NDArray[np.float64]  # (n,) A


class State(NamedTuple):
    """All that the parts go on from."""

    rotor: NDArray[np.float64]
    parts: dict[str, NDArray[np.float64]]
    """By the names of `Machine.parts`."""
    last: Last


class Moving(NamedTuple):
    """A rotor that has been started, and what compiled code steps of it."""

    rotor: Rotor
    stepped: Any


class Machine:
    """Controller, sensors and plant of a scenario, put into the order of the loop.

    Parameters
    ----------
    scenario : ResolvedScenario
    files : Files
        Model and torque curves.
    law : Law
        In force.
    moving : Moving, optional
        A rotor at work; one that starts as the scenario says unless given.

    Attributes
    ----------
    law : Law
        In force.
    signals : tuple of Signal
        Columns of the telemetry.
    columns : int
        Numbers in a row of it.
    law_error : LawError or None
        Exception of the law in compiled code; one of a law in plain Python is raised.

    Raises
    ------
    InputError
        The engine does not know all that the model holds, or the law cannot be used.
    """

    def __init__(
        self, scenario: ResolvedScenario, files: Files, law: Law, moving: Moving | None = None
    ) -> None:
        self._scenario = scenario
        self._moving = moving or _started(scenario, files)
        self._last = Last(np.empty(0), np.empty(0), np.zeros(len(files.actuator.groups)))
        self.law = law
        self.law_error: LawError | None = None
        self.signals = assembly.signals_of(scenario, files.actuator, self.law)
        self.columns = width(self.signals)
        magnetics = assembly.nominal_magnetics(scenario, files)
        estimator = assembly.estimator_of(scenario)
        joined = wiring.wires_of(scenario, len(files.actuator.groups))
        supervision = wiring.supervision_of(scenario, files.nominal, joined)
        self._controller = assembly.controller_of(scenario, self.law, magnetics, estimator, supervision)
        self._plant = assembly.plant_of(scenario, files.actuator, self._moving.stepped, joined)
        self._sensors = wiring.sensors_of(scenario, joined)
        self._faults = wiring.faults_of(scenario, self._plant, self._sensors, supervision.groups)
        # The loop has bare addresses of its functions: they are held for as long as it is.
        self._functions = matching(
            self.law,
            ALLOCATIONS[scenario.allocation],
            estimator.step if estimator else None,
            check_bounds=scenario.controller.check_bounds,
        )
        self._may_raise = is_own(law) or scenario.controller.check_bounds
        self._parts = (
            self._functions.law,
            self._functions.allocate,
            self._functions.estimate,
            self._controller,
            self._sensors,
            self._plant,
            assembly.places_of(self.signals, self.law),
            loops.Scratch(np.empty((3, 3)), np.empty((6 if scenario.controller.prediction.on else 3, 3))),
        )
        self._loop = for_types_of(self._functions.loop, NO_INPUTS, *self._parts, np.empty((0, self.columns)))

    @property
    def q_rad(self) -> NDArray[np.float64]:
        """Hinge angles now, (3,) in rad."""
        return self._moving.stepped.q.copy()

    @property
    def qdot_rad_s(self) -> NDArray[np.float64]:
        """Hinge rates now, (3,) in rad/s."""
        return self._moving.stepped.qdot.copy()

    @property
    def reason(self) -> Reason:
        """Why a watchdog has taken the currents away, if one has."""
        return REASONS[int(self._controller.supervision.watchdog.reason[0])]

    def apply_faults(self, tick: int) -> int:
        """Apply the faults that are due at a control tick; returns the next one at which others may be."""
        return self._faults.apply(tick)

    def run(self, inputs: loops.Inputs, log: NDArray[np.float64]) -> tuple[int, int]:
        """Run a control tick for each row of `log`: rows written, and the code of a status."""
        ticks, code = self._run(inputs, log)
        if ticks:
            row, first = log[ticks - 1], loops.CURRENT_COMMAND
            self._last = Last(
                row[loops.ANGLE : loops.ANGLE + 3].copy(),
                inputs.noise[ticks - 1].copy(),
                row[first : first + len(self._plant.current)].copy(),
            )
        return ticks, code

    def _run(self, inputs: loops.Inputs, log: NDArray[np.float64]) -> tuple[int, int]:
        """Run the loop; keep the first exception of a compiled law."""
        if not self._may_raise:
            return self._loop(inputs, *self._parts, log)
        raised: list[BaseException] = []

        def receive(error: BaseException) -> None:
            raised.append(error)
            self._controller.torque_q[:] = np.nan  # whatever it wrote before

        with callback_errors(receive):
            ticks, code = self._loop(inputs, *self._parts, log)
        if raised and self.law_error is None:
            # A watchdog lets the currents run down from the tick on.
            t_s = inputs.t[ticks - int(self._controller.supervision.watchdog.ticks_since_trip[0])]
            self.law_error = LawError.of(self.law.name, t_s, raised[0])
        return ticks, code

    def changed(self, scenario: ResolvedScenario, files: Files, own_law: Law | None) -> Machine:
        """Machine of another scenario that carries on what this one is in the midst of.

        A law that stays keeps its memory, and its parameters, which it may have changed. With other gains, or
        told of another nominal model, it keeps its memory where that is still of the same size. After
        currents by hand it begins anew, as does what stands around it.
        """
        same = scenario.plant == self._scenario.plant
        moving = self._moving if same else _carried_on(self._moving, scenario, files)
        law = own_law or self._law_for(scenario)
        made = Machine(scenario, files, law, moving)
        made._plant.current[:] = self._plant.current
        made._plant.last_qdot[:] = self._plant.last_qdot
        made._last = self._last
        drivings.carried_on(self._plant.driving, made._plant.driving, self._last.command)
        senses.carried_on(self._sensors, made._sensors, scenario.sensors, self._last.q, self._last.noise)
        _supervised_on(self._controller.supervision, made._controller.supervision)
        if scenario.manual.on or not self._scenario.manual.on:
            self._law_carried_on(made, own_law)
        transfer_applied_torque(self._controller.applied_torque, made._controller.applied_torque)
        if type(scenario.estimator) is type(self._scenario.estimator):
            made._controller.estimator_state.memory[:] = self._controller.estimator_state.memory
        return made

    def _law_carried_on(self, made: Machine, own_law: Law | None) -> None:
        """Let the law of another machine, and what stands around it, go on from where these are."""
        before, after = self._controller, made._controller
        same_kind = own_law is None and type(made._scenario.controller) is type(self._scenario.controller)
        if made.law is self.law:
            after.parameters[:] = before.parameters
        if made.law is self.law or (same_kind and len(after.memory) == len(before.memory)):
            after.memory[:] = before.memory
        transfer_compensators(before.compensators, after.compensators)

    def _law_for(self, scenario: ResolvedScenario) -> Law:
        """Law that a scenario names: the present one where nothing that it is made from has changed."""
        before = self._scenario
        same = before.controller.without_compensators() == scenario.controller.without_compensators()
        same = same and assembly.same_known(before, scenario)
        return self.law if same else assembly.law_of(scenario)

    def state(self) -> State:
        """All that it goes on from."""
        parts = {name: save_state(part) for name, part in self.parts.items()}
        return State(self._moving.rotor.state(), parts, self._last)

    @property
    def parts(self) -> dict[str, Any]:
        """Parts that it goes on from, apart from the rotor, by the names that messages use."""
        controller, supervision = self._controller, self._controller.supervision
        return {
            "currents": self._plant.current,
            "the last rates": self._plant.last_qdot,
            "the drive's state": self._plant.driving,
            "the law's parameters": controller.parameters,
            "the law's memory": controller.memory,
            "the applied torque": controller.applied_torque,
            "the governor, the prediction and the feed-forward": controller.compensators,
            "the estimator's memory": controller.estimator_state.memory,
            "the sensors' state": self._sensors,
            "the groups' states": supervision.groups,
            "the detector's state": supervision.detector,
            "the watchdog's state": supervision.watchdog,
        }

    def restore(self, state: State) -> None:
        """Go on from a state of a machine of the same scenario.

        Raises
        ------
        InputError
            It is that of another.
        """
        own, last = self.state(), state.last
        # Everything is checked before anything is written: a snapshot that is refused changes nothing.
        check_length("the engine's state", state.rotor, len(own.rotor))
        for name, numbers in own.parts.items():
            check_length(name, state.parts.get(name, np.empty(0)), len(numbers))
        check_length("the last command", last.command, len(self._plant.current))
        check_length("the last pose", last.q, 3 if len(last.q) else 0)
        self._moving.rotor.restore(state.rotor)
        for name, part in self.parts.items():
            restore_state(part, state.parts[name], name)
        self._last = last


def _started(scenario: ResolvedScenario, files: Files) -> Moving:
    rotor, section = assembly.rotor_of(scenario, files), scenario.plant
    return Moving(rotor, rotor.start(np.array(section.initial_rad), np.array(section.initial_rad_s)))


def _carried_on(moving: Moving, scenario: ResolvedScenario, files: Files) -> Moving:
    """Rotor of another scenario, in the same state."""
    rotor, state = assembly.rotor_of(scenario, files), moving.rotor.state()
    stepped = rotor.start(moving.stepped.q, moving.stepped.qdot)
    if len(rotor.state()) == len(state):  # else a body has come or gone: pose and rates are what remains
        rotor.restore(state)
    return Moving(rotor, stepped)


def _supervised_on(before: Supervision, after: Supervision) -> None:
    """Go on with what was seen before, under other figures."""
    transfer_state(before.groups, after.groups)
    if before.detector.on:
        transfer_state(before.detector, after.detector)
    transfer_watchdog(before.watchdog, after.watchdog)
