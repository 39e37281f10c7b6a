"""``spheretwin simulate SCENARIO``: run one scenario, headless or live."""

from __future__ import annotations

import argparse
import contextlib
import json
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.models.errors import InputError
from spheretwin.twin import flags, metrics
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.scenario import Scenario
from spheretwin.twin.simulation import Run, Simulation, Sink
from spheretwin.viz import tables
from spheretwin.viz.progress import Progress

EXAMPLE = "nutation"


def add_to(verbs: Any) -> None:
    """Add the verb to the command's parser."""
    names = ", ".join(scenarios.shipped())
    parser = verbs.add_parser(
        "simulate",
        help="run a scenario",
        description="Run a scenario. Any field of it is a flag: --controller.law pd --disturbance.load 1",
        usage="spheretwin simulate SCENARIO [options] [--section.field VALUE ...]",
        add_help=False,
        allow_abbrev=False,
    )
    parser.add_argument("scenario", metavar="SCENARIO", nargs="?", help=f"{names}, or a .toml file")
    parser.add_argument("--record", type=Path, metavar="FILE.rrd", help="write a Rerun recording")
    parser.add_argument("--telemetry", type=Path, metavar="FILE.parquet", help="write the telemetry")
    parser.add_argument(
        "--live", action="store_true", help="run at the pace of the clock, with a viewer on 127.0.0.1"
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON, alone on stdout")
    parser.add_argument("-h", "--help", action="store_true", help="show this help and the scenario's fields")
    parser.set_defaults(run=run, parser=parser)


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the verb; True when the run completed."""
    if options.help:
        options.parser.print_help()
        scenario = scenarios.load(options.scenario or EXAMPLE, flags.overrides(rest))
        tables.print_fields(scenario.name, flags.described(scenario))
        return True
    if options.scenario is None:
        raise InputError(
            f"command line: expected a scenario ({', '.join(scenarios.shipped())}), received none"
        )
    scenario = scenarios.load(options.scenario, flags.overrides(rest))
    for path in filter(None, (options.record, options.telemetry)):
        _check_writable(path)
    finished = _simulate(scenario, options)
    summary = metrics.summary(finished)
    if options.telemetry:
        finished.telemetry.write_parquet(options.telemetry, _metadata(summary))
    if options.json:
        print(json.dumps(summary, allow_nan=False))
    else:
        tables.print_run(scenario.name, finished.scenario.controller.law, summary)
        tables.print_files(options.record, options.telemetry)
    if finished.status != "completed":
        print(f"spheretwin: {_ending(finished)}", file=sys.stderr)
    return finished.status == "completed"


def _simulate(scenario: Scenario, options: argparse.Namespace) -> Run:
    simulation = Simulation(scenario)
    with contextlib.ExitStack() as stack:
        sinks: list[Sink] = [stack.enter_context(Progress(scenario.name, simulation.scenario.ticks))]
        if options.record or options.live:
            from spheretwin.viz.recording import Recorder  # Rerun is slow to import

            recorder = Recorder(
                simulation.actuator,
                simulation.signals,
                simulation.scenario.model_dump(mode="json"),
                path=options.record,
                live=options.live,
            )
            sinks.append(stack.enter_context(recorder))
            if recorder.viewer:
                print(f"watch: {recorder.viewer.address}", file=sys.stderr, flush=True)
        stop_requested = stack.enter_context(_interruptible())
        finished = simulation.run(sinks, live=options.live, stop_requested=stop_requested)
        if options.live and sys.stderr.isatty():
            print("the run has ended; Ctrl-C closes the viewer", file=sys.stderr, flush=True)
            while not stop_requested():
                time.sleep(0.1)
        return finished


@contextlib.contextmanager
def _interruptible() -> Iterator[Callable[[], bool]]:
    """Let Ctrl-C end the run at the next chunk, so that nothing computed is lost; a second one is abrupt."""
    pressed = []

    def press(*_: object) -> None:
        pressed.append(True)
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, press)
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, before)


def _metadata(summary: dict[str, Any]) -> dict[str, str]:
    """What the telemetry file says of itself: nothing that differs between two equal runs."""
    return {
        "scenario": json.dumps(summary["scenario"]),
        "status": summary["status"],
        "versions": json.dumps(summary["versions"]),
    }


def _check_writable(path: Path) -> None:
    """Find out before the run, and leave no empty file where the run then fails to start."""
    if path.is_dir():
        raise InputError(f"output: expected a file name, received the folder {path}")
    existed = path.exists()
    try:
        with open(path, "ab"):
            pass
    except OSError as error:
        raise InputError(f"output: expected a writable path, {error}") from None
    if not existed:
        path.unlink()


def _ending(run: Run) -> str:
    if len(run.telemetry) == 0:
        return f"the run ended before its first tick was complete: {run.status}"
    t_s, q = run.telemetry["t_s"][-1], np.degrees(run.telemetry["q_rad"][-1])
    pose = ", ".join(f"{name} {angle:.1f}°" for name, angle in zip("αβγ", q, strict=True))
    return f"the run ended at {t_s:.3f} s of {run.scenario.duration:g} s: {run.status} ({pose})"
