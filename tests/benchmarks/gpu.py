"""Rows of studies on a GPU: ``make gpu``, or ``python tests/benchmarks/gpu.py [--json]``.

First the same random rows on the GPU and on the processor, then ticks per second of the kernels, then a whole
sweep. Each kernel has a process of its own, so that they are compiled side by side. Without a GPU the kernels
are compiled to the assembly of one, and nothing is measured.
"""

import contextlib
import multiprocessing
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
from measuring import bound_of, options_of, report, seconds_of, tell_value

from spheretwin.envs import CudaVectorEnv
from spheretwin.loop.cuda_block import CudaBlock
from spheretwin.models.base import cuda
from spheretwin.models.base.errors import InputError
from spheretwin.study.grid import Grid
from spheretwin.study.row import Rows
from spheretwin.study.study import FOLDER, made

ROWS = 1000
"""Rows of each law that are compared, over all hardware sets."""

AXES = {
    "ideal": {
        "plant.modelling_error": (-0.2, 0.5),
        "disturbance.load": (0.0, 2.0),
        "plant.payload_kg": (0.0, 0.05),
    },
    "electronics": {
        "sensors.adc.gain_error": (0.0, 2e-3),
        "drive.resistance_ohm": (1.2, 1.4),
        "drive.supply_V": (23.0, 25.0),
    },
    "prototype": {"drive.coil_coupling": (0.1, 0.9), "plant.stiction.break_away": (1.1, 1.6)},
}
SETS = tuple(AXES)
LAWS = {"pd": ("_rad", 1e-12), "afsm": ("", 5e-3)}
"""End of the names of the figures that are compared, and their largest difference: of angles in rad, of
all figures as a part of them."""

AT_LEAST = {("ideal", "pd"): 450e6, ("ideal", "afsm"): 250e6, ("electronics", "afsm"): 80e6}
"""Ticks per second, on one H100 or H200."""

CAPABILITY = (9, 0)

WIDE, TICKS, CALLS = 32_768, 200, 3
PERIODS, PLANTS, PERIODS_AT_LEAST = 500, 65_536, 200e6
SWEEP_ROWS, SWEEP_AT_MOST_S = 100_000, 10.0


def study_of(hardware, law, samples, duration):
    """Rows that differ in random numbers of their hardware set and those before it."""
    bounds = {field: ends for name in SETS[: SETS.index(hardware) + 1] for field, ends in AXES[name].items()}
    axes = [
        {"field": field, "kind": "uniform", "low": low, "high": high} for field, (low, high) in bounds.items()
    ]
    fields = {"hardware": hardware, "duration": duration}
    study = {"scenario": "sinusoid", "fields": fields, "law": [{"law": law}], "axis": axes}
    return made({"name": "gpu", "design": "random", "samples": samples, **study}, "gpu")


def rows_of(study, count):
    """Rows of a study and its numbers."""
    rows, grid = Rows(study), Grid(study)
    drawn = np.random.default_rng().choice(len(grid), count, replace=False)
    return rows, [grid[number] for number in drawn.tolist()]


def largest_difference(hardware, law):
    """Largest difference of the figures of random rows."""
    (end, _), (rows, drawn) = LAWS[law], rows_of(study_of(hardware, law, 10 * ROWS, 1.0), ROWS // len(SETS))
    here, there = rows.run(drawn), rows.with_block(CudaBlock).run(drawn)
    largest = 0.0
    for own, other in zip(here, there, strict=True):
        assert (own.status, own.error) == (other.status, other.error), (own, other)
        for name, value in own.figures.items():
            if name.endswith(end) and isinstance(value, float):
                scale = 1.0 if end else max(abs(value), 1e-9)
                largest = max(largest, abs(value - other.figures[name]) / scale)
    return largest


def speed(hardware, law):
    """Ticks per second of a kernel; its compilation, set-up and the way of the inputs do not count."""
    launch, taken = cuda.launch, []

    def timed(*arguments):
        with ALONE[0]:
            taken.append(seconds_of(lambda: launch(*arguments)))

    period_s = 1e-3
    rows, drawn = rows_of(study_of(hardware, law, 2 * WIDE, CALLS * TICKS * period_s), WIDE)
    with patch.object(cuda, "launch", timed), patch("spheretwin.loop.block.BLOCK_TICKS", TICKS):
        rows.with_block(CudaBlock).run(drawn)
    return WIDE * TICKS / min(taken)


def periods(num_envs=PLANTS):
    """Control periods of an environment per second, currents; the actions are on the GPU."""
    env = CudaVectorEnv(num_envs, "Track", actions="current")
    env.reset(seed=0)
    actions = cuda.on_device(np.random.default_rng().uniform(-0.1, 0.1, env.action_space.shape))
    env.step(actions)
    seconds = seconds_of(lambda: [env.step(actions) for _ in range(PERIODS)])
    return num_envs * PERIODS / seconds


@contextlib.contextmanager
def compiled_only(sizes):
    """Compile kernels for compute capability 9.0, and do not run them; append the bytes of their assembly."""
    from numba import cuda as compiler
    from numba import typeof

    def compile_only(kernel, threads, arguments):
        sizes.append(len(compiler.compile_ptx(kernel.py_func, (typeof(arguments),), cc=CAPABILITY)[0]))

    same = {"check_gpu": lambda: "none", "on_device": lambda value: value}
    same |= {"borrowed": lambda value: value, "send": lambda value, copy: None}
    card = SimpleNamespace(compute_capability=CAPABILITY)
    with (
        patch("numba.cuda.dispatcher.get_current_device", lambda: card),
        patch.multiple(cuda, launch=compile_only, fetch=lambda copy, value: None, **same),
    ):
        yield


def compiled_bytes(hardware, law):
    """Bytes of the assembly of a kernel; needs no GPU."""
    sizes, (rows, drawn) = [], rows_of(study_of(hardware, law, 4, 0.01), 2)
    with compiled_only(sizes):
        rows.with_block(CudaBlock).run(drawn)
    return sizes[0]


OWN_LAW = """
import numpy as np

def step(t, reference, measurement, parameters, state, torque):
    for axis in range(3):
        x = measurement[0, axis] - reference[0, axis]
        y = np.sqrt(np.abs(x)) + np.exp(x) + np.expm1(x) + np.log1p(x) + np.cbrt(x) + np.square(x)
        y += np.floor(x) + np.ceil(x) + np.trunc(x) + np.rint(x) + np.fmod(x, 0.5) + np.power(x, 3.0)
        y += np.copysign(x, y) + np.sign(x)
        y += np.sin(x) + np.cos(x) + np.tanh(x) + np.arctan2(x, y) + np.maximum(x, y) + np.fabs(x)
        torque[axis] = y if np.isfinite(y) else 0.0
"""


def compiled_own_law():
    """Bytes of the assembly of a kernel with a law in plain Python and functions of NumPy; needs no GPU."""
    sizes = []
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "own.py").write_text(OWN_LAW)
        rows, drawn = rows_of(study_of("ideal", f"{folder}/own.py:step", 4, 0.01), 2)
        with compiled_only(sizes):
            rows.with_block(CudaBlock).run(drawn)
    return sizes[0]


def compiled_environment():
    """Bytes of the assembly of the kernels of an environment; needs no GPU."""
    sizes = []
    with compiled_only(sizes):
        env = CudaVectorEnv(2, "Track", actions="current", variants=1)
        env.reset(seed=0)
        env.step(np.zeros(env.action_space.shape))
    return sum(sizes)


ALONE = []
"""Lock of the GPU: sets of rows are prepared side by side, and timed one after the other."""


def work(channel, alone, hardware, law):
    """Answer the questions of a pipe: names of functions of this file."""
    ALONE.append(alone)
    with contextlib.suppress(EOFError):  # the other end has what it wants
        while True:
            channel.send(globals()[channel.recv()](hardware, law))


def kernels(alone):
    """Return a process for each kernel, by hardware set and law; the lock must live as long."""
    context, channels = multiprocessing.get_context("spawn"), {}
    for hardware in SETS:
        for law in LAWS:
            channels[hardware, law], other = context.Pipe()
            context.Process(target=work, args=(other, alone, hardware, law), daemon=True).start()
    return channels


def ask(channels, question):
    """Return the answers of all processes to a question."""
    for channel in channels.values():
        channel.send(question)
    return {name: channel.recv() for name, channel in channels.items()}


def sweep_seconds():
    """Time of a whole sweep of `robustness`, s."""
    study = (FOLDER / "robustness.toml").read_text()
    command = [sys.executable, "-m", "spheretwin", "sweep", "many.toml", "--engine", "cuda"]
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "many.toml").write_text(study.replace("samples = 10000", f"samples = {SWEEP_ROWS}"))
        return seconds_of(lambda: subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL))


def row(name, value, at_most=None, at_least=None):
    """Row of a figure in the form of `measuring.ratio`."""
    ok = (at_most is None or value <= at_most) and (at_least is None or value >= at_least)
    return {"name": name, "value": value, "at_most": at_most, "at_least": at_least, "ok": ok}


def main():
    """Measure, and print the table."""
    as_json = options_of(__doc__).json
    started, alone = time.perf_counter(), multiprocessing.get_context("spawn").Lock()
    try:
        card = cuda.check_gpu()
    except InputError as error:
        print(f"no GPU: {error}")
        for (hardware, law), size in ask(kernels(alone), "compiled_bytes").items():
            print(f"{hardware}, {law}: {size / 1e6:.2f} MB of assembly")
        print(f"own law: {compiled_own_law() / 1e6:.2f} MB of assembly")
        print(f"environment: {compiled_environment() / 1e6:.2f} MB of assembly")
        return
    channels, table = kernels(alone), []
    for (hardware, law), value in ask(channels, "largest_difference").items():
        table.append(row(f"difference of figures, {hardware}, {law}", value, at_most=LAWS[law][1]))
    for names, value in ask(channels, "speed").items():
        table.append(row(f"ticks/s, {', '.join(names)}", value, at_least=AT_LEAST.get(names)))
    table.append(row("periods/s of environments, currents", periods(), at_least=PERIODS_AT_LEAST))
    seconds = sweep_seconds()
    table.append(row(f"whole sweep of {SWEEP_ROWS} rows, s", seconds, at_most=SWEEP_AT_MOST_S))
    if as_json:
        report(table, as_json, card=card)
    else:
        for own in table:
            tell_value(f"{own['value']:.3g}", bound_of(own), own["name"], own["ok"])
        print(f"{card}; {time.perf_counter() - started:.0f} s")
    sys.exit(not all(own["ok"] for own in table))


if __name__ == "__main__":
    main()
