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
from typing import TYPE_CHECKING, Any

import numpy as np

from spheretwin.models.errors import InputError
from spheretwin.models.files import check_writable
from spheretwin.twin import flags, metrics
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.simulation import Run, Simulation
from spheretwin.viz import tables
from spheretwin.viz.progress import Progress

if TYPE_CHECKING:
    from spheretwin.viz.recording import Recorder

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
    _check_outputs([path for path in (options.record, options.telemetry) if path])
    with contextlib.ExitStack() as stack:
        stop_requested = stack.enter_context(_interruptible())
        simulation = Simulation(scenario)
        progress = Progress(scenario.name, simulation.scenario.ticks)
        recorders = [stack.enter_context(_recorder(simulation, options))] if _records(options) else []
        with progress:
            finished = simulation.run(
                [progress, *recorders], live=options.live, stop_requested=stop_requested
            )
        _report(finished, options)
        if options.live and sys.stderr.isatty():
            print("the run has ended; Ctrl-C closes the viewer", file=sys.stderr, flush=True)
            while not stop_requested():
                time.sleep(0.1)
    return finished.status == "completed"


def _records(options: argparse.Namespace) -> bool:
    return bool(options.record or options.live)


def _recorder(simulation: Simulation, options: argparse.Namespace) -> Recorder:
    from spheretwin.viz.recording import Recorder  # Rerun is slow to import

    scenario = simulation.scenario.model_dump(mode="json")
    recorder = Recorder(
        simulation.actuator, simulation.signals, scenario, path=options.record, live=options.live
    )
    if recorder.viewer:
        print(f"watch: {recorder.viewer.address}", file=sys.stderr, flush=True)
    return recorder


def _report(finished: Run, options: argparse.Namespace) -> None:
    """Write the telemetry, print the figures."""
    summary = metrics.summary(finished)
    if options.telemetry:
        finished.telemetry.write_parquet(options.telemetry, _metadata(summary))
    if options.json:
        print(json.dumps(summary, allow_nan=False), flush=True)
    else:
        tables.print_run(finished.scenario.name, finished.scenario.controller.law, summary)
        tables.print_files(options.record, options.telemetry)
    if finished.status != "completed":
        print(f"spheretwin: {_ending(finished)}", file=sys.stderr, flush=True)


@contextlib.contextmanager
def _interruptible() -> Iterator[Callable[[], bool]]:
    """Let Ctrl-C, or the end of the session, end the run at the next chunk: nothing computed is lost."""
    asked = []
    before = {number: signal.signal(number, lambda *_: asked.append(True)) for number in _ENDINGS}
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


_ENDINGS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)
]


def _metadata(summary: dict[str, Any]) -> dict[str, str]:
    """What the telemetry file says of itself: nothing that differs between two equal runs."""
    return {
        "scenario": json.dumps(summary["scenario"]),
        "status": summary["status"],
        "versions": json.dumps(summary["versions"]),
    }


def _check_outputs(paths: Sequence[Path]) -> None:
    """Find out before the run whether its files can be written."""
    for path in paths:
        check_writable(path)
    if len({path.resolve() for path in paths}) < len(paths):
        raise InputError(f"output: expected a path of its own for each file, received {paths[0]} twice")


def _ending(run: Run) -> str:
    if len(run.telemetry) == 0:
        return f"the run ended before its first tick was complete: {run.status}"
    t_s, q = run.telemetry["t_s"][-1], np.degrees(run.telemetry["q_rad"][-1])
    pose = ", ".join(f"{name} {angle:.1f}°" for name, angle in zip("αβγ", q, strict=True))
    return f"the run ended at {t_s:.3f} s of {run.scenario.duration:g} s: {run.status} ({pose})"
