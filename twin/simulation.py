"""One run of a scenario: build the parts, run the loop in chunks, keep what it says."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from spheretwin.control import laws
from spheretwin.control.law import SIGNATURE, Law
from spheretwin.models import actuator as actuators
from spheretwin.models.actuator import Actuator, Group
from spheretwin.models.compiled import compiled_callback
from spheretwin.models.errors import InputError
from spheretwin.models.magnetics import torque_model
from spheretwin.models.telemetry import SIGNALS, Signal, Table, width
from spheretwin.twin import loop as loops
from spheretwin.twin.loop import Inputs, Memory, Settings
from spheretwin.twin.plant.drive import Drive, drive
from spheretwin.twin.plant.engine import Rotor
from spheretwin.twin.plant.lagrangian import LagrangianRotor
from spheretwin.twin.scenario import DriveSection, Scenario

STATUS = {
    loops.COMPLETED: "completed",
    loops.LEFT_WORKSPACE: "left_workspace",
    loops.DIVERGED: "diverged",
}
INTERRUPTED = "interrupted"

PlantKind = Literal["mujoco", "lagrangian"]

# Long enough to make the calls between chunks cheap, short enough for a progress bar and for Ctrl-C.
CHUNK_STEPS = 2000
LIVE_CHUNK_S = 0.02


class Sink(Protocol):
    """Whatever follows a run while it goes on: a recorder, a progress bar."""

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk."""

    def finish(self, status: str) -> None:
        """Take note of how the run ended."""


@dataclass(frozen=True)
class Run:
    """What a run left.

    Attributes
    ----------
    scenario : Scenario
        Resolved: what was left open is filled in from the model and the trajectory.
    status : str
        ``completed``, ``left_workspace``, ``diverged`` or ``interrupted``.
    telemetry : Table
        One row a control tick, up to where the run ended.
    wall_s : float
        Wall time of the simulated loop alone, s.
    """

    scenario: Scenario
    status: str
    telemetry: Table
    wall_s: float


class Simulation:
    """A scenario with its parts built, ready to run once.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    law : Law, optional
        Runs instead of the law that the scenario names.
    plant : str
        ``mujoco``, or ``lagrangian`` for the same run on the equations of motion, to cross-check it.

    Raises
    ------
    InputError
        The model file, the torque curve or the law cannot be used.
    """

    def __init__(self, scenario: Scenario, law: Law | None = None, plant: PlantKind = "mujoco") -> None:
        section, period = scenario.plant, scenario.controller.period_s
        mjcf = Path(section.mjcf or actuators.MJCF_PATH)
        self.actuator = actuators.load(mjcf, Path(section.torque_curve or actuators.TORQUE_CURVE_PATH))
        self.law = law or laws.build(scenario.controller, self.actuator, period)
        self._inputs = _inputs(scenario)
        pose = section.initial_rad or tuple(self._inputs.reference[0, 0].tolist())
        _check_pose(pose, self.actuator)
        self.scenario, self._drive = _resolved(scenario, self.actuator.group, pose)
        self._settings = Settings(
            scenario.substeps,
            self.actuator.hinge_range_rad,
            np.array(section.modelling_torque_Nm),
            scenario.controller.surface_slope,
            scenario.allocation == "bounded",
        )
        settings = (section.step_s, section.integrator, section.modelling_error, section.payload_kg)
        self._rotor: Rotor | LagrangianRotor = (
            Rotor(mjcf, *settings) if plant == "mujoco" else LagrangianRotor(self.actuator, *settings)
        )

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Columns of the telemetry: the common ones, then the law's own."""
        return SIGNALS + self.law.signals

    def run(
        self,
        sinks: Iterable[Sink] = (),
        *,
        live: bool = False,
        stop_requested: Callable[[], bool] = lambda: False,
    ) -> Run:
        """Run from the start.

        Parameters
        ----------
        sinks : iterable of Sink
            Each is handed the telemetry chunk by chunk.
        live : bool
            Keep pace with the clock, in chunks of 20 ms.
        stop_requested : callable
            Asked between chunks; True ends the run with the status ``interrupted``.
        """
        sinks = list(sinks)
        advance, log = self._start()
        n, done, code = self.scenario.ticks, 0, loops.COMPLETED
        chunk = self._chunk_ticks(live)
        advance(0, 0)  # compiles, so that the clock below times the loop alone
        started, wall = time.perf_counter(), 0.0
        while done < n and code == loops.COMPLETED and not stop_requested():
            first, before = done, time.perf_counter()
            done, code = advance(first, min(first + chunk, n))
            wall += time.perf_counter() - before
            if code == loops.COMPLETED and self._rotor.warnings():
                code = loops.DIVERGED
            table = Table(self.signals, log[first:done])
            for sink in sinks:
                sink.write(table)
            if live:
                _sleep_until(started + done * self.scenario.controller.period_s)
        status = STATUS[code] if code or done == n else INTERRUPTED
        for sink in sinks:
            sink.finish(status)
        return Run(self.scenario, status, Table(self.signals, log[:done]), wall)

    def _chunk_ticks(self, live: bool) -> int:
        if live:
            return max(1, round(LIVE_CHUNK_S / self.scenario.controller.period_s))
        return max(1, CHUNK_STEPS // self.scenario.substeps)

    def _start(self) -> tuple[Callable[[int, int], tuple[int, int]], NDArray[np.float64]]:
        engine = self._rotor.start(np.array(self.scenario.plant.initial_rad), np.zeros(3))
        memory = Memory(np.zeros(len(self.actuator.groups)), self.law.state.copy())
        log = _allocated(self.scenario.ticks, width(self.signals))
        run_loop, step = _matching(self.law)
        magnetics = torque_model(self.actuator)

        def advance(first: int, last: int) -> tuple[int, int]:
            return run_loop(
                first,
                last,
                step,
                self.law.parameters,
                memory,
                self._inputs,
                self._settings,
                engine,
                magnetics,
                self._drive,
                log,
            )

        return advance, log


def simulate(scenario: Scenario, law: Law | None = None, sinks: Sequence[Sink] = ()) -> Run:
    """Run a scenario to its end.

    Parameters
    ----------
    scenario : Scenario
        From `scenario.load`, or built in Python.
    law : Law, optional
        Runs instead of the law that the scenario names.
    sinks : sequence of Sink
        Handed the telemetry while the run goes on.
    """
    return Simulation(scenario, law).run(sinks)


def _matching(law: Law) -> tuple[Callable[..., tuple[int, int]], Callable[..., Any]]:
    """The compiled loop for a law that can be compiled, the uncompiled one for a plain function."""
    if not isinstance(law.step, Dispatcher) and not law.step.__module__.startswith("spheretwin."):
        return loops.loop.py_func, law.step
    try:
        return loops.loop, compiled_callback(SIGNATURE, law.step)
    except (NumbaError, TypeError) as error:
        complaint = next(filter(None, map(str.strip, str(error).splitlines())), "")
        raise InputError(
            f"law {law.name}: expected a function that compiles as {SIGNATURE}, received: {complaint}"
        ) from error


def _inputs(scenario: Scenario) -> Inputs:
    """Everything that is known before the run: times, reference, disturbance."""
    t = scenario.controller.period_s * np.arange(scenario.ticks, dtype=np.float64)
    generator = np.random.default_rng(scenario.seed)
    reference = np.ascontiguousarray(scenario.trajectory.sample(t))
    disturbance = scenario.disturbance.sample(t, generator)
    for name, samples in (("trajectory", reference), ("disturbance", disturbance)):
        lost = np.flatnonzero(~np.isfinite(samples.reshape(len(t), -1)).all(axis=1))
        if len(lost):
            raise InputError(
                f"scenario {scenario.name}: expected a finite {name} for {scenario.duration:g} s,"
                f" received infinity at {t[lost[0]]:g} s"
            )
    return Inputs(t, reference, disturbance)


def _check_pose(pose: Sequence[float], actuator: Actuator) -> None:
    low, high = actuator.hinge_range_rad.T
    if np.any(pose < low) or np.any(pose > high):
        limits = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in actuator.hinge_range_rad)
        received = ", ".join(f"{angle:.4g}" for angle in pose)
        raise InputError(f"scenario: expected a first pose within {limits} rad, received {received}")


def _allocated(ticks: int, columns: int) -> NDArray[np.float64]:
    try:
        return np.zeros((ticks, columns))
    except MemoryError:
        needed = ticks * columns * 8 / 2**30
        raise InputError(
            f"scenario: expected telemetry that fits in memory, received {needed:.1f} GiB"
        ) from None


def _resolved(scenario: Scenario, group: Group, pose: tuple[float, float, float]) -> tuple[Scenario, Drive]:
    """Scenario whose open values are filled in, and the drive that they make."""
    given = scenario.drive
    time_constant_s, limit_A = given.time_constant_s, given.current_limit_A
    if time_constant_s is None:
        time_constant_s = group.inductance_H / group.resistance_ohm
    if limit_A is None:
        limit_A = group.current_limit_A
    filled = DriveSection(time_constant_s=time_constant_s, current_limit_A=limit_A)
    plant = scenario.plant.model_copy(update={"initial_rad": pose})
    lag = drive(time_constant_s, scenario.plant.step_s, limit_A)
    return scenario.model_copy(update={"drive": filled, "plant": plant}), lag


def _sleep_until(moment: float) -> None:
    time.sleep(max(0.0, moment - time.perf_counter()))
