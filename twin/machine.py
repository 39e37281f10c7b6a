"""The parts of one twin at work: built from a scenario, built anew where it changes, kept and restored."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control import belief as beliefs
from spheretwin.control.allocation.registry import ALLOCATIONS
from spheretwin.control.around import around as arounds
from spheretwin.control.controller import Supervision
from spheretwin.control.law import Law
from spheretwin.control.supervision import detector, groups, watchdog
from spheretwin.control.supervision.watchdog import REASONS, Reason
from spheretwin.models.base.compiled import callback_errors, for_types_of
from spheretwin.models.base.errors import InputError, LawError
from spheretwin.models.magnetics import kept_matrix
from spheretwin.models.telemetry.signals import width
from spheretwin.twin import assembly
from spheretwin.twin import loop as loops
from spheretwin.twin.electronics.driving import stages as drivings
from spheretwin.twin.electronics.sensing import stages as senses
from spheretwin.twin.plant.rotor import Rotor
from spheretwin.twin.scenario.files import Files
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.trajectories.trajectory import Triple
from spheretwin.twin.wiring import wires as wiring
from spheretwin.twin.wiring.matching import is_own, matching

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
    last_qdot: NDArray[np.float64]  # (3,) rad/s at the start of the last physics step
    current: NDArray[np.float64]
    driving: NDArray[np.float64]
    parameters: NDArray[np.float64]
    memory: NDArray[np.float64]
    belief: NDArray[np.float64]
    around: NDArray[np.float64]
    estimates: NDArray[np.float64]
    sensing: NDArray[np.float64]
    groups: NDArray[np.float64]
    detector: NDArray[np.float64]
    watchdog: NDArray[np.float64]
    last: Last


class Moving(NamedTuple):
    """A rotor that has been started, and what compiled code steps of it."""

    rotor: Rotor
    stepped: Any


class Machine:
    """Controller, sensors and plant of a scenario, put into the order of the loop.

    Parameters
    ----------
    scenario : Scenario
        Resolved.
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

    def __init__(self, scenario: Scenario, files: Files, law: Law, moving: Moving | None = None) -> None:
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
        self._controller = assembly.controller_of(
            scenario, self.law, magnetics, kept_matrix(magnetics), estimator, supervision
        )
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

    def strike(self, tick: int) -> int:
        """Let the faults act that are due at a control tick; returns the next one at which others may."""
        return self._faults.strike(tick)

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
            t_s = inputs.t[ticks - int(self._controller.supervision.watchdog.since[0])]
            self.law_error = LawError.of(self.law.name, t_s, raised[0])
        return ticks, code

    def changed(self, scenario: Scenario, files: Files, own_law: Law | None) -> Machine:
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
        senses.carried_on(self._sensors, made._sensors, self._last.q, self._last.noise)
        _supervised_on(self._controller.supervision, made._controller.supervision)
        if scenario.manual.on or not self._scenario.manual.on:
            self._law_carried_on(made, own_law)
        beliefs.carried_on(self._controller.belief, made._controller.belief)
        if type(scenario.estimator) is type(self._scenario.estimator):
            made._controller.estimates.memory[:] = self._controller.estimates.memory
        return made

    def _law_carried_on(self, made: Machine, own_law: Law | None) -> None:
        """Let the law of another machine, and what stands around it, go on from where these are."""
        before, after = self._controller, made._controller
        same_kind = own_law is None and type(made._scenario.controller) is type(self._scenario.controller)
        if made.law is self.law:
            after.parameters[:] = before.parameters
        if made.law is self.law or (same_kind and len(after.memory) == len(before.memory)):
            after.memory[:] = before.memory
        arounds.carried_on(before.around, after.around)

    def _law_for(self, scenario: Scenario) -> Law:
        """Law that a scenario names: the present one where nothing that it is made from has changed."""
        before = self._scenario
        same = before.controller.alone() == scenario.controller.alone()
        same = same and assembly.same_known(before, scenario)
        return self.law if same else assembly.law_of(scenario)

    def state(self) -> State:
        """All that it goes on from."""
        controller = self._controller
        return State(
            rotor=self._moving.rotor.state(),
            last_qdot=self._plant.last_qdot.copy(),
            current=self._plant.current.copy(),
            driving=drivings.state_of(self._plant.driving),
            parameters=controller.parameters.copy(),
            memory=controller.memory.copy(),
            belief=beliefs.state_of(controller.belief),
            around=arounds.state_of(controller.around),
            estimates=controller.estimates.memory.copy(),
            sensing=senses.state_of(self._sensors),
            groups=groups.state_of(controller.supervision.groups),
            detector=detector.state_of(controller.supervision.detector),
            watchdog=watchdog.state_of(controller.supervision.watchdog),
            last=self._last,
        )

    def restore(self, state: State) -> None:
        """Go on from a state of a machine of the same scenario.

        Raises
        ------
        InputError
            It is that of another.
        """
        own = self.state()
        _check_length("the engine's state", state.rotor, own.rotor)
        _check_length("currents", state.current, own.current)
        _check_length("the drive's state", state.driving, own.driving)
        _check_length("the law's parameters", state.parameters, own.parameters)
        _check_length("the law's memory", state.memory, own.memory)
        _check_length("what the controller believes", state.belief, own.belief)
        _check_length("what stands around the law", state.around, own.around)
        _check_length("the estimator's memory", state.estimates, own.estimates)
        _check_length("the sensors' state", state.sensing, own.sensing)
        _check_length("the groups", state.groups, own.groups)
        self._moving.rotor.restore(state.rotor)
        self._plant.last_qdot[:] = state.last_qdot
        self._plant.current[:] = state.current
        drivings.restore(self._plant.driving, state.driving)
        self._controller.parameters[:] = state.parameters
        self._controller.memory[:] = state.memory
        beliefs.restore(self._controller.belief, state.belief)
        arounds.restore(self._controller.around, state.around)
        self._controller.estimates.memory[:] = state.estimates
        senses.restore(self._sensors, state.sensing)
        groups.restore(self._controller.supervision.groups, state.groups)
        detector.restore(self._controller.supervision.detector, state.detector)
        watchdog.restore(self._controller.supervision.watchdog, state.watchdog)
        self._last = state.last


def _started(scenario: Scenario, files: Files) -> Moving:
    rotor, section = assembly.rotor_of(scenario, files), scenario.plant
    return Moving(rotor, rotor.start(_array(section.initial_rad), _array(section.initial_rad_s)))


def _carried_on(moving: Moving, scenario: Scenario, files: Files) -> Moving:
    """Rotor of another scenario, in the same state."""
    rotor, state = assembly.rotor_of(scenario, files), moving.rotor.state()
    stepped = rotor.start(moving.stepped.q, moving.stepped.qdot)
    if len(rotor.state()) == len(state):  # else a body has come or gone: pose and rates are what remains
        rotor.restore(state)
    return Moving(rotor, stepped)


def _supervised_on(before: Supervision, after: Supervision) -> None:
    """Go on with what was seen before, under other figures."""
    groups.restore(after.groups, groups.state_of(before.groups))
    if before.detector.on:
        detector.restore(after.detector, detector.state_of(before.detector))
    watchdog.carried_on(before.watchdog, after.watchdog)


def _array(values: Triple | None) -> NDArray[np.float64]:
    return np.array(values or (0.0, 0.0, 0.0))


def _check_length(what: str, received: NDArray[np.float64], own: NDArray[np.float64]) -> None:
    if len(received) != len(own):
        raise InputError(
            f"session: expected a snapshot with {len(own)} numbers of {what}, received {len(received)}"
        )
