"""Runtime of one twin: builds, rebuilds, saves and restores the components of the loop."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.controller import controller_of
from spheretwin.control.law import Law
from spheretwin.control.supervision.watchdog import REASONS, Reason, transfer_trip
from spheretwin.electronics.drive_chain import transfer_drive
from spheretwin.electronics.sensor_chain import measure_again
from spheretwin.loop import closed_loop as loops
from spheretwin.loop.assembly import assembled, law_of, rotor_of, same_nominal_model
from spheretwin.loop.closed_loop import is_python_law, is_user_law, step_that_writes
from spheretwin.loop.external import Connection, ExternalController, ExternalPlant
from spheretwin.loop.hardware_assembly import faults_of
from spheretwin.loop.stages import stages_of
from spheretwin.models.base.callback_errors import callback_errors
from spheretwin.models.base.compiled import COMPILES, for_types_of, uncompiled, without_fields
from spheretwin.models.base.errors import InputError, LawError
from spheretwin.models.base.record import set_states, states_of, transfer_rows
from spheretwin.models.base.turns import outside_turn
from spheretwin.models.telemetry.signals import width
from spheretwin.plant.rotor import Rotor
from spheretwin.scenario.changes import StateChange
from spheretwin.scenario.files import Files
from spheretwin.scenario.sections import ResolvedScenario

# Only for the types.
NO_INPUTS = loops.Inputs(
    np.empty(0), np.empty((0, 3, 3)), np.empty((0, 3)), np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0))
)

_PYTHON_LAW = ctypes.CFUNCTYPE(None, ctypes.c_double)


class LastTick(NamedTuple):
    """Values of the last tick that a new hold element needs; empty before the first tick."""

    q: NDArray[np.float64]  # (3,) rad
    noise: NDArray[np.float64]  # (k,) of the sensors
    command: NDArray[np.float64]  # (n,) A


class RuntimeState(NamedTuple):
    """Complete state of a `Runtime`."""

    run: NDArray[np.float64]
    """States of the record of the run."""
    engine: NDArray[np.float64]
    law_parameters: NDArray[np.float64]
    law_memory: NDArray[np.float64]
    estimator_memory: NDArray[np.float64]
    last: LastTick


class Runtime:
    """Controller, sensors and plant of a scenario, and the loop that runs them.

    Parameters
    ----------
    scenario : ResolvedScenario
    files : Files
        Model and torque curves.
    law : Law
        Active law.
    rotor : Rotor, optional
        Started; default: one that starts at the initial pose and rates of the scenario.
    external : ExternalController or ExternalPlant, optional
        Replaces the controller or the plant of the scenario.

    Attributes
    ----------
    rows : array of one RunData
        Data of the run.
    law : Law
        Active law.
    signals : tuple of Signal
        Columns of the telemetry.
    row_width : int
        Numbers in a row of the telemetry.
    law_error : LawError or None
        Exception of the law.

    Raises
    ------
    InputError
        The engine does not support the model, or the law cannot be used.
    """

    def __init__(
        self,
        scenario: ResolvedScenario,
        files: Files,
        law: Law,
        rotor: Rotor | None = None,
        external: ExternalController | ExternalPlant | None = None,
    ) -> None:
        self._scenario, self._external = scenario, external
        self._groups = len(files.actuator.groups)
        self._last = LastTick(np.empty(0), np.empty(0), np.zeros(self._groups))
        self.law = law
        self.law_error: LawError | None = None
        self._assembly = assembly = assembled(scenario, files, law, rotor)
        self.signals, self.row_width = assembly.signals, width(assembly.signals)
        self.rows, self._rotor = assembly.rows, assembly.rotor
        self._data = self.rows["controller"]
        self._controller = uncompiled(controller_of)(assembly.controllers, 0)
        self._faults = faults_of(scenario, self.rows)
        self._may_raise = is_user_law(law) or scenario.controller.check_bounds
        if COMPILES and is_python_law(law):
            self._python_law = _PYTHON_LAW(self._call_law(step_that_writes(law)))
            self._data["python_law"] = ctypes.cast(self._python_law, ctypes.c_void_p).value or 0
        self._connection = Connection(external, self.rows)
        # Last: the rotor belongs to another runtime if this one is refused.
        self._rotor.rows = self.rows["plant"]["rotor"]

    def _call_law(self, step: Callable[..., None]) -> Callable[[float], None]:
        """Return a function of the time of a tick that calls a law in plain Python."""
        data, own = self._data[0], (self._controller.parameters, self._controller.memory)
        measurement = data.measurement[: loops.measured_rows(data)]
        given = data.reference, measurement, *own, data.torque_q

        def call(t_s: float) -> None:
            step(t_s, *given)

        return call

    @property
    def q_rad(self) -> NDArray[np.float64]:
        """Current hinge angles, (3,) in rad."""
        return self._plant.rotor.q.copy()

    @property
    def qdot_rad_s(self) -> NDArray[np.float64]:
        """Current hinge rates, (3,) in rad/s."""
        return self._plant.rotor.qdot.copy()

    @property
    def _plant(self) -> Any:
        return self.rows[0].plant

    @property
    def _watchdog(self) -> Any:
        return self._data[0].supervision.watchdog

    @property
    def reason(self) -> Reason:
        """Reason for which a watchdog has switched off the currents, if it has."""
        return REASONS[self._watchdog.reason]

    @cached_property
    def loop(self) -> Callable[[loops.Inputs, NDArray[np.float64]], tuple[int, int]]:
        """Loop of the components, a function of inputs and rows; the first access compiles it."""
        assembly = self._assembly
        parts = (
            *assembly.functions[:3],
            self._controller,
            uncompiled(stages_of)(assembly.stages(), 0),
            assembly.law_signals,
            self._connection.external,
        )
        entry = for_types_of(loops.loop, NO_INPUTS, *parts, np.empty((0, self.row_width)))

        given = tuple(map(without_fields, parts)) if COMPILES else parts

        def run(inputs: loops.Inputs, log: NDArray[np.float64]) -> tuple[int, int]:
            return entry(inputs, *given, log)

        return run

    def apply_faults(self, tick: int) -> int:
        """Apply the faults that are due at a control tick; return the next tick at which they may change."""
        return self._faults.apply(tick)

    def run(self, inputs: loops.Inputs, log: NDArray[np.float64]) -> tuple[int, int]:
        """Run a control tick for each row of `log`; return the rows written and the code of a status."""
        ticks, code = self._run(inputs, log)
        if ticks:
            first = loops.CURRENT_COMMAND
            row = log[ticks - 1, : first + self._groups].copy()  # the caller owns the log
            self._last = LastTick(row[loops.ANGLE : loops.ANGLE + 3], inputs.noise[ticks - 1], row[first:])
        return ticks, code

    def _run(self, inputs: loops.Inputs, log: NDArray[np.float64]) -> tuple[int, int]:
        """Run the loop and store the first exception of the law."""
        if not self._may_raise:
            with outside_turn:
                done = self.loop(inputs, log)
            self._connection.raise_error()
            return done
        raised: list[BaseException] = []

        def receive(error: BaseException) -> None:
            raised.append(error)
            self._data["torque_q"] = np.nan  # the law may have written part of a torque

        with outside_turn, callback_errors(receive):
            ticks, code = self.loop(inputs, log)
        self._connection.raise_error()
        if raised and isinstance(raised[0], KeyboardInterrupt):
            raise raised[0]
        if raised and self.law_error is None:
            # With a watchdog the loop goes on after the exception, while the currents decay.
            t_s = inputs.t[ticks - self._watchdog.ticks_since_trip]
            self.law_error = LawError.of(self.law.name, t_s, raised[0])
        return ticks, code

    def transfer_to(
        self,
        scenario: ResolvedScenario,
        files: Files,
        user_law: Law | None,
        trial: Runtime | None = None,
    ) -> Runtime:
        """Return a runtime of another scenario that continues from the state of this one.

        An unchanged law keeps its memory and its parameters, which it may have modified. A law with other
        gains or another nominal model keeps its memory if the size is still the same. After manual currents
        the law and its compensators start again. The law of `trial`, an unused runtime, is taken if it is the
        law of the scenario.
        """
        same = scenario.plant == self._scenario.plant
        rotor = self._rotor if same else _transfer_rotor(self._rotor, scenario, files)
        law = user_law or self._law_for(scenario) or (trial and trial._law_for(scenario))
        law = law or law_of(scenario)
        other = Runtime(scenario, files, law, rotor, self._external)
        other._last = self._last
        self._transfer_state(other, user_law)
        return other

    def _transfer_state(self, other: Runtime, user_law: Law | None) -> None:
        """Copy the state into a runtime of another scenario, without the parts that start again."""
        before, after, was, is_now = self.rows, other.rows, self._scenario, other._scenario
        measure_again(after["sensors"], is_now.sensors, self._last.q, self._last.noise)
        after_manual = was.manual.on and not is_now.manual.on
        compensators = after["controller"]["compensators"].copy()
        transfer_rows(before, after)
        if after_manual:
            after["controller"]["compensators"] = compensators
        transfer_drive(before["plant"]["drive"], after["plant"]["drive"], self._last.command)
        transfer_trip(*(rows["controller"]["supervision"]["watchdog"] for rows in (before, after)))
        old, new = self._controller, other._controller
        same_law, same_kind = other.law is self.law, type(is_now.controller) is type(was.controller)
        if same_law and not after_manual:
            new.parameters[:] = old.parameters
        same_size = len(new.memory) == len(old.memory)
        if not after_manual and (same_law or (user_law is None and same_kind and same_size)):
            new.memory[:] = old.memory
        if type(is_now.estimator) is type(was.estimator):
            kept = min(len(old.estimator_memory), len(new.estimator_memory))
            new.estimator_memory[:kept] = old.estimator_memory[:kept]

    def _law_for(self, scenario: ResolvedScenario) -> Law | None:
        """Return the active law if nothing that it is built from differs in a scenario."""
        before = self._scenario
        same = before.controller.without_compensators() == scenario.controller.without_compensators()
        same = same and same_nominal_model(before, scenario)
        return self.law if same else None

    def set_state(self, change: StateChange) -> None:
        """Set the given parts of the state of the plant."""
        plant = self._plant
        for part, given in (
            (plant.rotor.q, change.q_rad),
            (plant.joint_q, change.q_rad),
            (plant.rotor.qdot, change.qdot_rad_s),
            (plant.last_qdot, change.qdot_rad_s),
            (plant.current, change.current_A),
        ):
            if given is not None:
                part[:] = given

    def state(self) -> RuntimeState:
        """Return the complete state."""
        own = self._controller
        memories = own.parameters.copy(), own.memory.copy(), own.estimator_memory.copy()
        return RuntimeState(states_of(self.rows)[0], self._rotor.state()[0], *memories, self._last)

    def restore(self, state: RuntimeState) -> None:
        """Restore the state of a runtime of the same scenario.

        Raises
        ------
        InputError
            The state is from another scenario.
        """
        own, controller = self.state(), self._controller
        # Everything is checked before anything is written: a snapshot that is refused changes nothing.
        for name in RuntimeState._fields[:-1]:
            _check_length(name, getattr(state, name), len(getattr(own, name)))
        _check_length("last command", state.last.command, self._groups)
        _check_length("last pose", state.last.q, 3 if len(state.last.q) else 0)
        set_states(self.rows, state.run[None])
        self._rotor.restore([state.engine])
        controller.parameters[:], controller.memory[:] = state.law_parameters, state.law_memory
        controller.estimator_memory[:], self._last = state.estimator_memory, state.last


def _check_length(name: str, numbers: Any, expected: int) -> None:
    if np.shape(numbers) != (expected,):
        raise InputError(
            f"session: expected a snapshot with {expected} numbers of the {name.replace('_', ' ')},"
            f" received {np.size(numbers)}"
        )


def _transfer_rotor(rotor: Rotor, scenario: ResolvedScenario, files: Files) -> Rotor:
    """Return the rotor of another scenario in the state of a started one."""
    other, state = rotor_of(scenario, files), rotor.state()
    other.start(rotor.rows["q"][0], rotor.rows["qdot"][0])
    if len(other.state()[0]) == len(state[0]):  # otherwise another number of bodies: pose and rates remain
        other.restore(state)
    return other
