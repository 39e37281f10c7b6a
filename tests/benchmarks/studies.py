"""Rows of studies: ``python tests/benchmarks/studies.py [--json]``.

Whole rows of one second, from number to figures, as a sweep runs them: on two threads over one, over what a
run of the same scenario took at an early commit of this repository, and the memory of ten thousand of them.
Both sides of a ratio are measured in turn, several times, and the fastest of each counts.
"""

import io
import os
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from measuring import fastest, options_of, ratio, report, seconds_of, tell_value

from spheretwin.loop.block import RunBlock
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.study.engines import threads as local
from spheretwin.study.grid import Grid
from spheretwin.study.row import Rows
from spheretwin.study.study import Study, load, made

ROOT = Path(__file__).parents[2]

EARLY = "7e0eb72"
"""Commit whose `simulate` is measured, of before there were studies."""

FOLDERS = ("models", "control", "viz", "twin")

# Where the package is, then: runs the scenario once for each line that comes in, and says how long it took.
EARLY_RUNS = """
import sys, time
from spheretwin.twin import scenario, simulation
assert simulation.__file__.startswith(sys.argv[1]), simulation.__file__
chosen = scenario.load("sinusoid", {"duration": 1.0})
for _ in sys.stdin:
    started = time.perf_counter()
    simulation.simulate(chosen)
    print(time.perf_counter() - started, flush=True)
"""

# A process counts the memory of whoever began it until it runs its own program: this one is small.
PEAK = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""
PEAK_UNIT_BYTES = 1 if sys.platform == "darwin" else 1024

# Few at a time, and often: a machine that is shared lends its second core for some milliseconds.
BLOCK_ROWS, BLOCKS, ROUNDS = 32, 2, 40
MANY_ROWS = 10_000
LARGEST_MB = 500


def afsm() -> Study:
    """Rows of the sinusoid under AFSM that differ in modelling error and seed."""
    axis = {"field": "plant.modelling_error", "kind": "linspace", "first": 0.0, "last": 0.5, "count": 6}
    fields = {"name": "afsm", "scenario": "sinusoid", "fields": {"duration": 1.0}, "law": [{"law": "afsm"}]}
    return made({**fields, "axis": [axis], "seeds": 8}, "afsm")


def rows_seconds(study: Study, threads: int) -> Callable[[], float]:
    """Time of whole rows, drawn at random, in blocks on some threads, s."""
    rows, grid = Rows(study), Grid(study)
    generator = np.random.default_rng()

    def work() -> None:
        drawn = generator.integers(len(grid), size=(BLOCKS, BLOCK_ROWS)).tolist()
        blocks = ([grid[number] for number in numbers] for numbers in drawn)
        landed = list(local.run_each(blocks, rows.run, threads))
        assert all(result.error is None for _, results in landed for result in results)

    return lambda: seconds_of(work)


def outside_seconds(study: Study) -> tuple[float, float]:
    """Processor time of a row outside of compiled loops, and within them, s."""
    rows, grid, within = Rows(study), Grid(study), 0.0
    loops = RunBlock.advance

    def timed(*arguments: Any) -> None:
        nonlocal within
        started = time.thread_time()
        loops(*arguments)
        within += time.thread_time() - started

    numbers = np.random.default_rng().integers(len(grid), size=4 * BLOCK_ROWS).tolist()
    rows.run([grid[number] for number in numbers])
    with patch.object(RunBlock, "advance", timed):
        started = time.thread_time()
        rows.run([grid[number] for number in numbers])
        whole = time.thread_time() - started
    return (whole - within) / len(numbers), within / len(numbers)


def row_seconds(engine: str) -> Callable[[], float]:
    """Time of one whole row on a plant, s."""
    rows, row = Rows(afsm()), Grid(afsm())[0]
    return lambda: seconds_of(lambda: rows.run([row], engine))


@contextmanager
def early_seconds() -> Iterator[Callable[[], float] | None]:
    """Time of `simulate` at the early commit, s; None where the history is not there."""
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder, "spheretwin")
        if not _extracted(package):
            yield None
            return
        environment = {**os.environ, "PYTHONPATH": folder, "SPHERETWIN_CACHE_DIR": str(Path(folder, "cache"))}
        command = [sys.executable, "-c", EARLY_RUNS, folder]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        with subprocess.Popen(command, env=environment, cwd=folder, **pipes) as process:

            def work() -> float:
                process.stdin.write("\n")
                process.stdin.flush()
                return float(process.stdout.readline())

            yield work
            process.stdin.close()


def _extracted(package: Path) -> bool:
    """Put the early package into a folder; False without the history, as in an archive of the sources."""
    command = ["git", "-C", str(ROOT), "archive", EARLY, *FOLDERS]
    try:
        done = subprocess.run(command, capture_output=True, check=False)
    except OSError:  # no git
        return False
    if done.returncode:
        return False
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        archive.extractall(package, filter="data")
    return True


def peak_MB(rows: int) -> float:
    """Largest memory of a process that sweeps the first rows of `robustness`, 10⁶ bytes.

    Another has compiled before what it needs: that takes memory too, but once for all sweeps.
    """
    with tempfile.TemporaryDirectory() as folder:
        sweep = [str(Path(sys.executable).with_name("spheretwin")), "sweep", "robustness"]
        first = [*sweep, "--limit", "1", "--out", str(Path(folder, "first"))]
        subprocess.run(first, check=True, capture_output=True)
        command = [*sweep, "--limit", str(rows), "--out", str(Path(folder, "out"))]
        done = subprocess.run(
            [sys.executable, "-S", "-c", PEAK, *command], check=True, capture_output=True, text=True
        )
    return int(done.stdout) * PEAK_UNIT_BYTES / 1e6


def ratios() -> list[dict[str, Any]]:
    """Rows of the ratios; of those that cannot be measured there are none."""
    results = []
    with timers_stopped():
        for study in (afsm(), load("robustness")):
            count = BLOCKS * BLOCK_ROWS
            taken = fastest({each: rows_seconds(study, each) for each in (1, 2)}, ROUNDS)
            name = f"one thread over two, whole rows of 1 s, {study.name}"
            results.append(ratio(name, taken[1] / count, taken[2] / count, at_least=1.9))
            outside, within = min(outside_seconds(study) for _ in range(5))
            name = f"a row outside of its compiled loop over it, {study.name}"
            results.append(ratio(name, outside, within, at_most=0.1))
        with early_seconds() as early:
            if early:
                sides = {engine: row_seconds(engine) for engine in ("lagrangian", "mujoco")}
                taken = fastest({"early": early, **sides}, rounds=40)
                for engine, at_most in (("lagrangian", 0.1), ("mujoco", 0.4)):
                    name = f"row of 1 s under AFSM, {engine}, over a run of it at {EARLY}"
                    results.append(ratio(name, taken[engine], taken["early"], at_most=at_most))
    return results


def main() -> int:
    options = options_of(__doc__)
    rows, peak = ratios(), peak_MB(MANY_ROWS)
    kept = report(rows, options.json, peak_MB=peak, at_most_MB=LARGEST_MB)
    if not options.json:
        if not any(EARLY in row["name"] for row in rows):
            print(f"not measured: a row over a run at {EARLY}, as there is no history of this repository")
        tell_value(
            f"{peak:.0f}", f"<= {LARGEST_MB}", f"MB at the peak of {MANY_ROWS} rows", peak <= LARGEST_MB
        )
    return 0 if kept and peak <= LARGEST_MB else 1


if __name__ == "__main__":
    sys.exit(main())
