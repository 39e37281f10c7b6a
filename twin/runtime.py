"""Runtime of one twin: builds, rebuilds, saves and restores the components of the loop."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin import assembly
from spheretwin import loop as loops
from spheretwin.control.allocation import ALLOCATIONS
from spheretwin.control.law import Law
from spheretwin.control.supervision.watchdog import REASONS, Reason, transfer_trip
from spheretwin.electronics.drive_chain import transfer_drive
from spheretwin.electronics.sensor_chain import measure_again
from spheretwin.external import Connection, ExternalController, ExternalPlant
from spheretwin.hardware_assembly import faults_of, sensors_of
from spheretwin.loop import dispatch, is_python_law, is_user_law, step_that_writes
from spheretwin.models.base.compiled import COMPILES, for_types_of
from spheretwin.models.base.errors import LawError
from spheretwin.models.base.numba_internals.callbacks import callback_errors
from spheretwin.models.base.state import check_length, restore_state, save_state, transfer_state
from spheretwin.models.base.turns import outside_turn
from spheretwin.models.telemetry.signals import width
from spheretwin.plant.rotor import Rotor
from spheretwin.scenario.changes import StateChange
from spheretwin.scenario.files import Files
from spheretwin.scenario.sections import ResolvedScenario
from spheretwin.stages import compiled_stages

# Only for the types.
NO_INPUTS = loops.Inputs(
    np.empty(0), np.empty((0, 3, 3)), np.empty((0, 3)), np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0))
)

# Names of parts in messages.
LAW_PARAMETERS, LAW_MEMORY = "the law's parameters", "the law's memory"
COMPENSATORS = "the governor, the prediction and the feed-forward"
ESTIMATOR_MEMORY = "the estimator's memory"
WATCHDOG = "the watchdog's state"


_PYTHON_LAW = ctypes.CFUNCTYPE(None, ctypes.c_double)


class LastTick(NamedTuple):
    """Values of the last tick that a new hold element needs; empty before the first tick."""

    q: NDArray[np.float64]  # (3,) rad
    noise: NDArray[np.float64]  # (k,) of the sensors
    command: NDArray[np.float64]  # (n,) A


class RuntimeState(NamedTuple):
    """Complete state of a `Runtime`."""

    rotor: NDArray[np.float64]
    parts: dict[str, NDArray[np.float64]]
    """By the names of `Runtime.parts`."""
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
        self._rotor = rotor or _start_rotor(scenario, files)
        self._last = LastTick(np.empty(0), np.empty(0), np.zeros(len(files.actuator.groups)))
        self.law = law
        self.law_error: LawError | None = None
        self.signals = assembly.signals_of(scenario, files.actuator, self.law)
        self.row_width = width(self.signals)
        magnetics = assembly.nominal_magnetics(scenario, files)
        estimator = assembly.estimator_of(scenario)
        self._controller = assembly.controller_of(scenario, self.law, magnetics, estimator, files.nominal)
        self._data, self._sensors = self._controller.data, sensors_of(scenario)
        if hasattr(external, "command"):
            self._data["manual"]["on"] = True
        supervision = self._data["supervision"]
        halt = supervision["watchdog"]["halt"]
        self._plant = assembly.plant_of(scenario, files, self._rotor.rows, halt)
        self._faults = faults_of(scenario, self._plant, self._sensors, supervision["groups"])
        # The loop holds only addresses of its functions: this object keeps the functions alive.
        self._functions = dispatch(
            self.law,
            ALLOCATIONS[scenario.allocation],
            estimator.step if estimator else None,
            check_bounds=scenario.controller.check_bounds,
        )
        self._may_raise = is_user_law(law) or scenario.controller.check_bounds
        if COMPILES and is_python_law(law):
            self._python_law = _PYTHON_LAW(self._call_law(step_that_writes(law)))
            self._data["python_law"] = ctypes.cast(self._python_law, ctypes.c_void_p).value or 0
        self._connection = Connection(external, self._controller, self._plant)

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
        return self._rotor.rows["q"][0].copy()

    @property
    def qdot_rad_s(self) -> NDArray[np.float64]:
        """Current hinge rates, (3,) in rad/s."""
        return self._rotor.rows["qdot"][0].copy()

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
        stages, memory = compiled_stages(self._controller, self._sensors, self._plant, self.signals)
        parts = (
            self._functions.law,
            self._functions.allocate,
            self._functions.estimate,
            self._controller,
            stages,
            self.row_width - width(self.law.signals),
            self._sensors["fresh"][0],
            self._connection.external,
        )
        entry = for_types_of(loops.loop, NO_INPUTS, *parts, np.empty((0, self.row_width)))

        def run(inputs: loops.Inputs, log: NDArray[np.float64], _: object = memory) -> tuple[int, int]:
            return entry(inputs, *parts, log)

        return run

    def apply_faults(self, tick: int) -> int:
        """Apply the faults that are due at a control tick; return the next tick at which they may change."""
        return self._faults.apply(tick)

    def run(self, inputs: loops.Inputs, log: NDArray[np.float64]) -> tuple[int, int]:
        """Run a control tick for each row of `log`; return the rows written and the code of a status."""
        ticks, code = self._run(inputs, log)
        if ticks:
            first = loops.CURRENT_COMMAND
            row = log[ticks - 1, : first + len(self._plant.current)].copy()  # the caller owns the log
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
        law = law or assembly.law_of(scenario)
        other = Runtime(scenario, files, law, rotor, self._external)
        other._last = self._last
        measure_again(other._sensors, scenario.sensors, self._last.q, self._last.noise)
        before, after = self.parts, other.parts
        for name in before.keys() - self._parts_that_start_again(other, user_law):
            transfer_state(before[name], after[name])
        transfer_drive(self._plant.drive, other._plant.drive, self._last.command)
        transfer_trip(before[WATCHDOG], after[WATCHDOG])
        return other

    def _parts_that_start_again(self, other: Runtime, user_law: Law | None) -> set[str]:
        """Return the names of the parts that keep nothing of the state of this runtime in another one."""
        before, after, parts = self._scenario, other._scenario, set()
        same_law, same_kind = other.law is self.law, type(after.controller) is type(before.controller)
        same_size = len(other._controller.memory) == len(self._controller.memory)
        after_manual = before.manual.on and not after.manual.on
        if after_manual or not same_law:
            parts.add(LAW_PARAMETERS)
        if after_manual or not (same_law or (user_law is None and same_kind and same_size)):
            parts.add(LAW_MEMORY)
        if after_manual:
            parts.add(COMPENSATORS)
        if type(after.estimator) is not type(before.estimator):
            parts.add(ESTIMATOR_MEMORY)
        return parts

    def _law_for(self, scenario: ResolvedScenario) -> Law | None:
        """Return the active law if nothing that it is built from differs in a scenario."""
        before = self._scenario
        same = before.controller.without_compensators() == scenario.controller.without_compensators()
        same = same and assembly.same_nominal_model(before, scenario)
        return self.law if same else None

    def set_state(self, change: StateChange) -> None:
        """Set the given parts of the state of the plant."""
        plant, rotor = self._plant, self._rotor.rows[0]
        for part, given in (
            (rotor.q, change.q_rad),
            (rotor.qdot, change.qdot_rad_s),
            (plant.last_qdot, change.qdot_rad_s),
            (plant.current, change.current_A),
        ):
            if given is not None:
                part[:] = given

    def state(self) -> RuntimeState:
        """Return the complete state."""
        parts = {name: save_state(part) for name, part in self.parts.items()}
        return RuntimeState(self._rotor.state(), parts, self._last)

    @property
    def parts(self) -> dict[str, Any]:
        """Components with a state, except the rotor, by the names that messages use."""
        controller, data, supervision = self._controller, self._data, self._data["supervision"]
        return {
            "currents": self._plant.current,
            "the last rates": self._plant.last_qdot,
            "the drive's state": self._plant.drive,
            "the presliding state": self._plant.bristles,
            "the temperatures of stator and rotor": self._plant.heat,
            LAW_PARAMETERS: controller.parameters,
            LAW_MEMORY: controller.memory,
            "the applied torque": data["applied_torque"],
            COMPENSATORS: data["compensators"],
            ESTIMATOR_MEMORY: controller.estimator_memory,
            "the sensors' state": self._sensors,
            "the groups' states": supervision["groups"],
            "the detector's state": supervision["detector"],
            WATCHDOG: supervision["watchdog"],
        }

    def restore(self, state: RuntimeState) -> None:
        """Restore the state of a runtime of the same scenario.

        Raises
        ------
        InputError
            The state is from another scenario.
        """
        own, last = self.state(), state.last
        # Everything is checked before anything is written: a snapshot that is refused changes nothing.
        check_length("the engine's state", state.rotor, len(own.rotor))
        for name, numbers in own.parts.items():
            check_length(name, state.parts.get(name, np.empty(0)), len(numbers))
        check_length("the last command", last.command, len(self._plant.current))
        check_length("the last pose", last.q, 3 if len(last.q) else 0)
        self._rotor.restore(state.rotor)
        for name, part in self.parts.items():
            restore_state(part, state.parts[name], name)
        self._last = last


def _start_rotor(scenario: ResolvedScenario, files: Files) -> Rotor:
    rotor, section = assembly.rotor_of(scenario, files), scenario.plant
    rotor.start(np.array(section.initial_rad), np.array(section.initial_rad_s))
    return rotor


def _transfer_rotor(rotor: Rotor, scenario: ResolvedScenario, files: Files) -> Rotor:
    """Return the rotor of another scenario in the state of a started one."""
    other, state = assembly.rotor_of(scenario, files), rotor.state()
    other.start(rotor.rows["q"][0], rotor.rows["qdot"][0])
    if len(other.state()) == len(state):  # otherwise a body was added or removed: only pose and rates remain
        other.restore(state)
    return other
