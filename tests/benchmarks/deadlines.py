"""Deadlines of the bench's loop, and the latency of STOP: ``python tests/benchmarks/deadlines.py [SECONDS]``.

Each twin flies at the pace of the clock, alone and beside a thread of plain Python that looks at it without
rest. Both figures are those of the machine as much as of the loop: its load is told beside them.
"""

import os
import sys
import threading
import time

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench

TWINS = {
    "lagrangian": {"plant.engine": "lagrangian"},
    "mujoco": {},
    "electronics": {"hardware": "electronics"},
}
STOPS = 20


def looked_at(bench: Bench, ended: threading.Event) -> None:
    """Keep the interpreter busy with what a page asks for."""
    while not ended.is_set():
        bench.state(), bench.bins()
        sum(i * i for i in range(3000))


def flown(overrides: dict, looked: bool, seconds: float) -> tuple[float, float, float]:
    """Share of deadlines missed, and median and largest latency of STOP in ms."""
    ended = threading.Event()
    with Bench(scenarios.load("sinusoid", {"disturbance.load": 0.5, **overrides})) as bench:
        bench.begin()
        time.sleep(2.0)  # what a recording needs is imported then
        if looked:
            threading.Thread(target=looked_at, args=(bench, ended), daemon=True).start()
        bench.command("start").wait()
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            bench.command("set", name="disturbance.load", value=time.monotonic() % 0.5)
            time.sleep(0.05)
        missed = bench.state().missed_share
        latencies = []
        for stop in range(STOPS):
            time.sleep(0.1 + 0.003 * stop)  # at every place of a chunk
            ticket = bench.command("stop")
            ticket.wait()
            latencies.append(1e3 * (ticket.settled_s - ticket.created_s))
            bench.command("reset").wait()
            bench.command("start").wait()
        ended.set()
    return missed, float(np.median(latencies)), max(latencies)


def main() -> None:
    """Print a line for each twin."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    for name, overrides in TWINS.items():
        for looked in (False, True):
            missed, median_ms, largest_ms = flown(overrides, looked, seconds)
            print(
                f"{name:11} {'looked at' if looked else 'alone':10} deadlines missed {100 * missed:5.2f} %,"
                f" STOP after {median_ms:.1f} ms, at most {largest_ms:.1f} ms;"
                f" {os.getloadavg()[0]:.1f} processes want {os.cpu_count()} cores"
            )


if __name__ == "__main__":
    main()
