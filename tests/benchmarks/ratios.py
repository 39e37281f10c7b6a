"""Speed as ratios, each measured within one run: ``python tests/benchmarks/ratios.py [--json]``.

Machines differ and are shared, so only ratios have bounds. Both sides of a ratio are measured in turn,
several times, and the fastest of each counts: whatever else the machine does only ever adds time.
"""

import itertools
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import plain
from measuring import fastest, options_of, ratio, report, seconds_of

from spheretwin import plant
from spheretwin import scenario as scenarios
from spheretwin.control.allocation.bounded import SCRATCH_ROWS, allocate_bounded
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.base.compiled import compiled
from spheretwin.models.magnetics import fill_torque_matrix, scratch_of, torque_matrix, torque_model
from spheretwin.models.telemetry.signals import width
from spheretwin.plant.mass_properties import true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor
from spheretwin.plant.plant_step import step
from spheretwin.records.provenance import facts_of
from spheretwin.scenario.hardware import HARDWARE
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session
from spheretwin.simulation import follow, simulate
from spheretwin.trajectories.disturbances import Draws
from spheretwin.viz.recording.recorder import Recorder

SCENARIO = "nutation"
PLAIN_TICKS = 500
FEW_TICKS = 900  # within one block of what comes from outside
SESSIONS = 8
THINNED_Hz = 60.0


def loop_seconds(engine: str = "mujoco") -> float:
    """Loop time of one physics step, s."""
    run = simulate(scenarios.load(SCENARIO, {"plant.engine": engine}))
    return run.wall_s / (len(run.telemetry) * run.scenario.substeps)


def tick_seconds(ticks: int) -> float:
    """Time of one tick in a session that is advanced by some ticks at a time, s."""
    with Session(scenarios.load(SCENARIO)) as session:
        return seconds_of(lambda: [session.advance(ticks) for _ in range(FEW_TICKS // ticks)]) / FEW_TICKS


def set_up_seconds() -> float:
    """Time until a session is ready, s."""
    scenario = scenarios.load(SCENARIO)
    return seconds_of(lambda: Session(scenario))


def hardware_seconds(hardware: str) -> Callable[[], float]:
    """Loop time of a physics step of the tilt on one hardware set, s.

    Bearings are the same on all, and rows are written into memory that is there already: with electronics
    they are twice as wide, and a page of fresh memory takes longer than what is written into it.
    """
    bearings = {name: value for name, value in HARDWARE["electronics"].items() if name.startswith("plant.")}
    scenario = scenarios.load("tilt", {"hardware": hardware, **bearings})
    log = np.zeros((scenario.ticks, width(Session(scenario).signals)))

    def work() -> float:
        with Session(scenario) as session:
            session.advance_into(log)
            return session.loop_s / (scenario.ticks * scenario.substeps)

    return work


def brief_run_seconds() -> float:
    """Time of a whole run of one second, s."""
    scenario = scenarios.load(SCENARIO, {"duration": 1.0})
    return seconds_of(lambda: simulate(scenario))


def brief_loop_seconds() -> float:
    """Loop time of a run of one second, s."""
    return simulate(scenarios.load(SCENARIO, {"duration": 1.0})).wall_s


def threads_seconds(threads: int) -> Callable[[], float]:
    """Time of some prepared sessions on some threads, s."""

    def work() -> float:
        sessions = [Session(scenarios.load(SCENARIO)) for _ in range(SESSIONS)]
        with ThreadPoolExecutor(threads) as pool:
            return seconds_of(lambda: list(pool.map(lambda session: session.advance(2000), sessions)))

    return work


def bare_seconds() -> float:
    """Time of one `mj_step` on the same model, spinning as the nutation does, s."""
    rotor = _rotor()
    steps = 10_000
    return seconds_of(lambda: mujoco.mj_step(rotor.model, rotor.data, nstep=steps)) / steps


def plain_seconds() -> float:
    """Time of one physics step of the plain loop, s."""
    scenario = scenarios.load(SCENARIO)
    actuator, rotor = actuators.load(), _rotor()
    t = scenario.controller.period_s * np.arange(PLAIN_TICKS)
    reference = scenario.trajectory.sample(t)
    disturbance = scenario.disturbance.sample(
        t, Draws(partial(np.random.default_rng(0).random, PLAIN_TICKS), None)
    )
    rotor.start(reference[0, 0], np.zeros(3))
    law = plain.PlainAfsm(actuator.inertia, scenario.controller.period_s)
    work = seconds_of(
        lambda: plain.run(
            rotor.model, rotor.data, actuator, scenario, law, reference, disturbance, PLAIN_TICKS
        )
    )
    return work / (PLAIN_TICKS * scenario.substeps)


def torque_matrix_seconds() -> float:
    """Time of one torque matrix, s."""
    model, calls = torque_model(actuators.load()), 100_000
    q, G, scratch = np.array([0.1, 0.2, 0.3]), np.empty((3, 18)), scratch_of(model)
    _repeat(1, q, model, G, scratch)
    return seconds_of(lambda: _repeat(calls, q, model, G, scratch)) / calls


def plant_step_seconds() -> float:
    """Time of one public step of rotor and field, called from compiled code, s."""
    parameters, calls = plant.parameters("nutation"), 100_000
    state = plant.State(np.zeros(3), np.array([0.0, 0.0, 5.0]))
    _coast(1, state, np.zeros(18), np.zeros(3), parameters)
    return seconds_of(lambda: _coast(calls, state, np.zeros(18), np.zeros(3), parameters)) / calls


@compiled
def _coast(calls, state, currents, disturbance, parameters):
    for _ in range(calls):
        state = step(state, currents, disturbance, parameters, 5e-4)


def bounded_seconds() -> float:
    """Time of one bounded allocation where the limit acts, mean over poses and directions, s."""
    actuator, generator, cases = actuators.load(), np.random.default_rng(0), 2000
    poses = generator.uniform([-1, -1, -np.pi], [1, 1, np.pi], (cases, 3))
    G = np.stack([torque_matrix(q, actuator) for q in poses])
    torque = generator.normal(size=(cases, 3))
    limit = actuator.group.current_limit_A
    for matrix, wanted in zip(G, torque, strict=True):  # 1 to 3 times what least-norm currents can give
        wanted *= generator.uniform(1, 3) * limit / np.abs(np.linalg.pinv(matrix) @ wanted).max()
    scratch = np.empty((SCRATCH_ROWS, 18))
    _allocate_all(G[:1], torque, limit, scratch)
    return seconds_of(lambda: _allocate_all(G, torque, limit, scratch)) / cases


@compiled
def _allocate_all(G, torque, limit, scratch):
    current = np.empty(G.shape[2])
    for case in range(G.shape[0]):
        allocate_bounded(G[case], torque[case], limit, current, scratch)


@compiled
def _repeat(calls, q, model, G, scratch):
    for _ in range(calls):
        q[2] += 1e-3
        fill_torque_matrix(q, model.arrangement[0], model.tables, G, scratch)


def run_seconds(scenario: Scenario, folder: Path | None, rate_Hz: float | None = None) -> Callable[[], float]:
    """Time of one run within this process, s; recorded to a new file in `folder` if there is one."""
    names = itertools.count()

    def work() -> None:
        with Session(scenario) as session:
            if folder is None:
                follow(session, scenario.ticks, [])
                return
            path, facts = folder / f"run{next(names)}.rrd", facts_of(session.initial_scenario)
            with Recorder(session.actuator, session.signals, facts, path=path, rate_Hz=rate_Hz) as recorder:
                follow(session, scenario.ticks, [recorder])
            path.unlink()

    return lambda: seconds_of(work)


def process_seconds(*command: str) -> Callable[[], float]:
    """Time of a whole process, s; with bytecode kept, as Python does unless told otherwise."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    return lambda: seconds_of(
        lambda: subprocess.run(command, check=True, capture_output=True, env=environment)
    )


def _rotor() -> MujocoRotor:
    plant = scenarios.load(SCENARIO).plant
    model = true_model(mjcf.read(actuators.MJCF_PATH), plant.modelling_error, plant.payload_kg)
    rotor = MujocoRotor([model], plant.step_s, plant.integrator)
    rotor.start(np.zeros(3), np.array([0.2 * np.pi, 0.2, 2 * np.pi]))
    return rotor


def ratios() -> list[dict[str, object]]:
    """Measure everything; rows with name, value, bound (None: reported only) and the two sides in s."""
    simulated = [str(Path(sys.executable).with_name("spheretwin")), "simulate", SCENARIO]
    imports = [sys.executable, "-c", "import mujoco, numba, rerun"]
    with tempfile.TemporaryDirectory() as folder:
        brief, minute = scenarios.load(SCENARIO), scenarios.load("sinusoid", {"duration": 60.0})
        runs = fastest(
            {"recorded": run_seconds(brief, Path(folder)), "silent": run_seconds(brief, None)}, rounds=9
        )
        ways = {
            "recorded": (Path(folder), None),
            "thinned": (Path(folder), THINNED_Hz),
            "silent": (None, None),
        }
        minutes = fastest({name: run_seconds(minute, *way) for name, way in ways.items()}, rounds=5)
        commands = {"silent": simulated, "imports": imports}
        commands["recorded"] = [*simulated, "--record", f"{folder}/run.rrd"]
        processes = fastest({name: process_seconds(*each) for name, each in commands.items()}, rounds=5)
    inner = fastest(
        {
            "loop": loop_seconds, "bare": bare_seconds, "lagrangian": partial(loop_seconds, "lagrangian"),
            "G_t": torque_matrix_seconds, "plant step": plant_step_seconds, "bounded": bounded_seconds,
            "single": partial(tick_seconds, 1), "tick": partial(tick_seconds, FEW_TICKS),
            "set-up": set_up_seconds, "brief run": brief_run_seconds, "brief loop": brief_loop_seconds,
            "electronics": hardware_seconds("electronics"), "ideal": hardware_seconds("ideal"),
            "prototype": hardware_seconds("prototype"),
        },
        rounds=9,
    )  # fmt: skip
    threads = fastest({"one": threads_seconds(1), "two": threads_seconds(2)}, rounds=5)
    outer = fastest({"plain": plain_seconds, "loop": loop_seconds}, rounds=3)
    bare, loop, one_tick = inner["bare"], inner["loop"], inner["single"] - inner["tick"]
    electronics, prototype, command = inner["electronics"], inner["prototype"], processes["silent"]
    parts = electronics - inner["ideal"]
    return [
        ratio("closed loop over bare mj_step, a physics step", loop, bare, at_most=1.25),
        ratio("loop on the Lagrangian over that on MuJoCo", inner["lagrangian"], loop, at_most=0.2),
        ratio("plain Python loop over ours, a physics step", outer["plain"], outer["loop"], at_least=15),
        ratio("session ready, in bare mj_steps", inner["set-up"], bare, at_most=600),
        ratio("advance(1) beyond its tick, in bare mj_steps", one_tick, bare, at_most=3),
        ratio("a run of one second over its loop", inner["brief run"], inner["brief loop"], at_most=1.35),
        ratio("one thread over two, prepared sessions", threads["one"], threads["two"], at_least=1.7),
        ratio("run that records over one that does not", runs["recorded"], runs["silent"], at_most=1.3),
        ratio("a minute that records every row", minutes["recorded"], minutes["silent"], at_most=1.3),
        ratio("a minute that records 60 rows a second", minutes["thinned"], minutes["silent"], at_most=1.05),
        ratio("warm command with --record over without", processes["recorded"], command),
        ratio("warm command over importing its libraries", command, processes["imports"], at_most=2),
        ratio("complete electronics over bare mj_step, a physics step", parts, bare, at_most=0.17),
        ratio(
            "loop of the complete prototype over that of its electronics", prototype, electronics, at_most=1.6
        ),
        ratio("public plant step over bare mj_step", inner["plant step"], bare, at_most=0.2),
        ratio("one torque matrix over bare mj_step", inner["G_t"], bare),
        ratio("one bounded allocation at the limit over bare mj_step", inner["bounded"], bare),
    ]


def main() -> int:
    options = options_of(__doc__)
    return 0 if report(ratios(), options.json) else 1


if __name__ == "__main__":
    sys.exit(main())
