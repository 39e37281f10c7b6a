"""One run of a scenario: build the parts, run the loop in chunks, keep what it says."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numba.core.dispatcher import Dispatcher
from numpy.typing import NDArray

from spheretwin.control import laws
from spheretwin.control.law import SIGNATURE, Law
from spheretwin.models import actuator as actuators
from spheretwin.models.actuator import Group
from spheretwin.models.compiled import compiled_callback
from spheretwin.models.magnetics import torque_model
from spheretwin.models.telemetry import SIGNALS, Signal, Table, width
from spheretwin.twin import loop as loops
from spheretwin.twin.loop import Inputs, Memory, Settings
from spheretwin.twin.plant.drive import Drive, drive
from spheretwin.twin.plant.engine import Rotor
from spheretwin.twin.scenario import DriveSection, Scenario

STATUS = {
    loops.COMPLETED: "completed",
    loops.LEFT_WORKSPACE: "left_workspace",
    loops.DIVERGED: "diverged",
}
INTERRUPTED = "interrupted"

# Long enough to make the calls between chunks cheap, short enough for a progress bar.
CHUNK_TICKS = 1000
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
        Resolved: every value that was in force.
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

    Raises
    ------
    InputError
        The model file, the torque curve or the law cannot be used.
    """

    def __init__(self, scenario: Scenario, law: Law | None = None) -> None:
        plant, period = scenario.plant, scenario.controller.period_s
        mjcf = Path(plant.mjcf or actuators.MJCF_PATH)
        self.actuator = actuators.load(mjcf, Path(plant.torque_curve or actuators.TORQUE_CURVE_PATH))
        self.scenario, self._drive = _resolved(scenario, self.actuator.group)
        self.law = law or laws.build(scenario.controller, self.actuator, period)
        t = period * np.arange(scenario.ticks, dtype=np.float64)
        self._inputs = Inputs(
            t,
            np.ascontiguousarray(scenario.trajectory.sample(t)),
            scenario.disturbance.sample(t, np.random.default_rng(scenario.seed)),
        )
        self._settings = Settings(
            scenario.substeps,
            self.actuator.hinge_range_rad,
            np.array(plant.modelling_torque_Nm),
            scenario.controller.surface_slope,
        )
        self._rotor = Rotor(mjcf, plant.step_s, plant.integrator, plant.modelling_error, plant.payload_kg)

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
        chunk = max(1, round(LIVE_CHUNK_S / self.scenario.controller.period_s)) if live else CHUNK_TICKS
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

    def _start(self) -> tuple[Callable[[int, int], tuple[int, int]], NDArray[np.float64]]:
        initial = self.scenario.plant.initial_rad
        pose = self._inputs.reference[0, 0] if initial is None else np.array(initial)
        engine = self._rotor.start(pose, np.zeros(3))
        memory = Memory(np.zeros(len(self.actuator.groups)), self.law.state.copy())
        log = np.zeros((self.scenario.ticks, width(self.signals)))
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
    if isinstance(law.step, Dispatcher) or law.step.__module__.startswith("spheretwin."):
        return loops.loop, compiled_callback(SIGNATURE, law.step)
    return loops.loop.py_func, law.step


def _resolved(scenario: Scenario, group: Group) -> tuple[Scenario, Drive]:
    """Scenario whose open values are filled in from the model, and the drive they make."""
    given = scenario.drive
    time_constant_s, limit_A = given.time_constant_s, given.current_limit_A
    if time_constant_s is None:
        time_constant_s = group.inductance_H / group.resistance_ohm
    if limit_A is None:
        limit_A = group.current_limit_A
    filled = DriveSection(time_constant_s=time_constant_s, current_limit_A=limit_A)
    lag = drive(time_constant_s, scenario.plant.step_s, limit_A)
    return scenario.model_copy(update={"drive": filled}), lag


def _sleep_until(moment: float) -> None:
    time.sleep(max(0.0, moment - time.perf_counter()))
