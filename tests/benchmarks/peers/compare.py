"""Comparison of the closed loop with the best peers: ``make peers``.

Each peer must first agree with ours: one that computes something else is no peer. Then all are timed in
turn, several times, and the fastest of each counts. For a peer everything is prepared: it is compiled, and
its reference and disturbance are arrays. Ours is complete: a run is `simulate` with its telemetry, a row
is everything that a study does for it, from its values to the table. Of many rows both keep the same two
figures.
"""

import argparse
import importlib
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import partial

import numpy as np
import ours
from measuring import fastest, seconds_of
from problem import problem
from report import Report, Times

from spheretwin.simulation import simulate

# Ours over the best of JAX, a row.
AT_MOST = 0.4

# Under a smooth law two runs differ by rounding alone, as those of our own two plants do.
SAME_rad, SAME_A = 1e-9, 1e-6
# NumPy interpolates f_t linearly between samples 0.25 degrees apart: an error of 1e-4 of the peak, as much of
# the largest current (2.6 A), and of an angle the effect of this error of the currents in a control period.
LINEAR_rad, LINEAR_A = 1e-5, 1e-3
# Of each row's figures, relative. Under AFSM rounding may decide signs of s, as between our plants.
SAME_FIGURES = {"pd": 1e-9, "afsm": 5e-3}

ROWS, MJX_ROWS = 1024, 256

# Rows of a batch, and whether each core has its own batch; otherwise XLA uses all cores for one.
BATCHES = ((256, False), (1024, False), (256, True), (512, True))
MJX_BATCHES = ((128, True),)

ROUNDS = 3


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    report = Report(parser.parse_args().json)
    single_runs(report)
    rows = peer(report, "jax_rows")
    if rows:
        lagrangian, mjx = peer(report, "jax_lagrangian"), peer(report, "mjx_rotor")
        rotors = [(lagrangian, ROWS, BATCHES), *([(mjx, MJX_ROWS, MJX_BATCHES)] if mjx else [])]
        compare_traces(report, rows, [rotor for rotor, *_ in rotors])
        many_rows(report, "pd", rows, rotors)
        many_rows(report, "afsm", rows, rotors[:1])
    passed = report.finished()
    return 0 if passed and rows else 1  # without JAX the bound is not checked


def peer(report: Report, name: str):
    """Return the module of a peer; None if its library is not installed."""
    try:
        with redirect_stdout(sys.stderr):  # libraries print what they lack
            return importlib.import_module(name)
    except ImportError as error:
        report.not_installed(name, error)
        return None


def single_runs(report: Report) -> None:
    """Compare with peers that run one row at a time."""
    report.head("One run at a time, PD: time of a simulated second, of cores, and over ours")
    scenario, lagrangian = ours.scenario("pd"), ours.scenario("pd", "lagrangian")
    numbers, telemetry = problem(scenario), simulate(scenario).telemetry
    work = {"ours": partial(simulate, scenario), "ours, on the Lagrangian": partial(simulate, lagrangian)}
    for module in filter(None, (peer(report, "plain_mujoco"), peer(report, "drake_plant"))):
        compare_trace(report, module.NAME, module.run(numbers), telemetry, (LINEAR_rad, LINEAR_A))
        work[module.NAME] = partial(module.run, numbers)
    times = timed(work)
    for name, each in times.items():
        report.time(name, each.of(scenario.duration), times["ours"].of(scenario.duration))


def compare_traces(report: Report, rows, rotors) -> None:
    """Compare one run of each kind of rotor with ours."""
    report.head("Many rows at once: are they the same?")
    scenario = ours.scenario("pd")
    numbers, telemetry = problem(scenario), simulate(scenario).telemetry
    for rotor in rotors:
        compare_trace(report, rotor.NAME, rows.trace(numbers, rotor.Rotor), telemetry, (SAME_rad, SAME_A))


def compare_trace(report: Report, name: str, trace, telemetry, bounds) -> None:
    """Compare angles and currents of a complete run with ours; a run of another length differs."""
    units = {"q_rad": "rad", "current_A": "A"}
    for (column, unit), theirs, bound in zip(units.items(), trace, bounds, strict=True):
        same = theirs.shape == telemetry[column].shape
        apart = float(np.max(np.abs(theirs - telemetry[column]))) if same else np.inf
        report.agreement(f"{name}: {column} of PD over 5 s, largest difference", apart, bound, unit)


def many_rows(report: Report, law: str, rows, rotors) -> None:
    """Compare with peers that run many rows at once, and check the bound."""
    study = ours.study(law, ROWS)
    figures, numbers = ours.run_rows(study), ours.problems(study)
    mine, prepared = "ours, a study's rows", "ours, prepared rows, as a peer's"
    work = {mine: partial(ours.run_rows, study), prepared: ours.Prepared(study)}
    count, compile_s = dict.fromkeys(work, ROWS), dict.fromkeys(work)
    for rotor, most, batches in rotors:
        for batch, on_each_core in batches:
            name = f"{rotor.NAME}, {batch} rows {'on each core' if on_each_core else 'at once'}"
            work[name] = prepared_rows = rows.Rows(numbers[:most], rotor.Rotor, batch, on_each_core)
            compare_figures(report, f"{name}, {law}", prepared_rows(), figures, SAME_FIGURES[law])
            count[name], compile_s[name] = most, prepared_rows.compile_s
    report.head(f"{ROWS} rows of a second on all cores, {law}: time of a row, of cores, and over ours")
    of_row = {name: each.of(count[name]) for name, each in timed(work).items()}
    for name, each in of_row.items():
        report.time(name, each, of_row[mine], compile_s[name])
    peers = [each for name, each in of_row.items() if name not in (mine, prepared)]
    best, least = min(each.wall_s for each in peers), min(each.cores_s for each in peers)
    for name in (mine, prepared):
        report.ratio(f"{name}, over the best of JAX, {law}", of_row[name].wall_s / best, AT_MOST)
        report.ratio(f"the same, time of cores, {law}", of_row[name].cores_s / least)


def timed(work: dict[str, Callable[[], object]]) -> dict[str, Times]:
    """Return the least time of each, of the clock and of cores, over some rounds in turn."""
    cores = {name: [] for name in work}

    def measured(name: str) -> float:
        if isinstance(work[name], ours.Prepared):
            work[name].prepare()
        before = time.process_time()
        seconds = seconds_of(work[name])
        cores[name].append(time.process_time() - before)
        return seconds

    wall = fastest({name: partial(measured, name) for name in work}, ROUNDS)
    return {name: Times(wall[name], min(cores[name])) for name in work}


def compare_figures(report: Report, name: str, theirs, figures, bound: float) -> None:
    """Compare the figures of all rows with those of the study."""
    apart = [
        np.abs(getattr(theirs, figure) / known[: len(getattr(theirs, figure))] - 1)
        for figure, known in figures.items()
    ]
    report.agreement(
        f"{name}: errors of all rows, largest difference", float(np.max(apart)), bound, "relative"
    )


if __name__ == "__main__":
    sys.exit(main())
