"""Delay of the ticks of a link in real time compared with a bare timer: ``latency.py [SECONDS]``.

`machine` and `drive` run at 1 kHz on this computer, with a process that only waits for the same times, in two
ways: as an ordinary process, and with the permissions of both verbs.
"""

import json
import multiprocessing
import os
import subprocess
import sys
import time
from contextlib import nullcontext

from spheretwin.machine.link.real_time import Distribution, real_time

PERIOD_s, IDLE_s = 1e-3, 1000.0
VERB = [sys.executable, "-m", "spheretwin"]


def bare_timer(seconds: float, with_permissions: bool, queue: multiprocessing.Queue) -> None:
    """Wait for each millisecond, and put the delays."""
    delays = Distribution()
    with real_time() if with_permissions else nullcontext():
        due_s = time.monotonic()
        for _ in range(round(seconds / PERIOD_s)):
            due_s += PERIOD_s
            time.sleep(max(due_s - time.monotonic(), 0.0))
            delay_s = time.monotonic() - due_s
            delays.add(delay_s)
            if delay_s > PERIOD_s:  # as the link: no hurry after a pause
                due_s += delay_s
    queue.put(delays.figures())


def linked(seconds: float, start: multiprocessing.Event) -> dict[str, dict]:
    """Run both verbs, and return the delays of each."""
    times = ["--timeout-ms", str(1e3 * IDLE_s), "--json"]
    own = ["--listen", "udp://:0", "--real-time", "--hardware", "prototype", "--idle-s", str(IDLE_s)]
    common = {"stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(
        [*VERB, "machine", "sinusoid", *own, *times, "--duration", str(seconds + 60)],
        stderr=subprocess.PIPE, **common,
    ) as twin:  # fmt: skip
        address = f"udp://:{twin.stderr.readline().strip().rpartition(':')[2]}"
        ours = ["--machine", address, "--arm", "--estimator.kind", "kalman"]
        ours += ["--limit-rate-rad-s", "1e5", "--limit-chi2", "1e9"]
        start.set()
        done = subprocess.run(
            [*VERB, "drive", "sinusoid", *ours, *times, "--duration", str(seconds)], check=True, **common
        )
        out, _ = twin.communicate()
    results = {"drive": json.loads(done.stdout), "machine": json.loads(out)}
    return {name: result["link"]["jitter"] for name, result in results.items()}


def main() -> None:
    """Print a line for each process."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    queue, start = multiprocessing.Queue(), multiprocessing.Event()
    names = ("bare timer", "bare timer with permissions")
    rows = {}
    worker = multiprocessing.Process(target=_timers, args=(seconds, start, queue))
    worker.start()
    rows.update(linked(seconds, start))
    rows.update(zip(names, (queue.get(), queue.get()), strict=True))
    worker.join()
    for name, row in rows.items():
        print(
            f"{name:28}", *(f"{key.removesuffix('_ms')} {1e3 * value:.0f} µs" for key, value in row.items())
        )
    ratio = rows["drive"]["max_ms"] / rows["bare timer with permissions"]["max_ms"]
    print(
        f"largest delay of drive over that of the timer {ratio:.2f}; {os.getloadavg()[0]:.1f} processes run"
    )


def _timers(seconds: float, start: multiprocessing.Event, queue: multiprocessing.Queue) -> None:
    start.wait()
    time.sleep(5.0)  # the verbs connect
    for with_permissions in (False, True):
        bare_timer(seconds / 2, with_permissions, queue)


if __name__ == "__main__":
    main()
