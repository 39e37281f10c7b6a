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
from spheretwin.models.mujoco_library import timers_stopped
from spheretwin.models.telemetry_file import TelemetryFile
from spheretwin.twin import flags, metrics, replay
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.metrics import Figures
from spheretwin.twin.replay import Plan
from spheretwin.twin.session import Session
from spheretwin.twin.simulation import COMPLETED, follow
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
    parser.add_argument(
        "--replay", type=Path, metavar="RUN.parquet", help="run again what a telemetry file says of itself"
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
    plan = _planned(options, rest)
    _check_outputs([path for path in (options.record, options.telemetry) if path])
    with contextlib.ExitStack() as stack:
        stop_requested = stack.enter_context(_interruptible())
        session = stack.enter_context(Session(plan.scenario))
        figures = Figures(plan.ticks)
        progress = Progress(plan.scenario.name, plan.ticks)
        file = _telemetry_file(session, options)
        recorders = [stack.enter_context(_recorder(session, options))] if _records(options) else []
        with progress, timers_stopped():
            status = follow(
                session,
                plan.ticks,
                [progress, figures, *([file] if file else []), *recorders],
                journal=plan.journal,
                live=options.live,
                stop_requested=stop_requested,
            )
        _report(session, plan, status, figures, options)
        if file:
            file.close(replay.facts(session))
        if options.live and sys.stderr.isatty():
            print("the run has ended; Ctrl-C closes the viewer", file=sys.stderr, flush=True)
            while not stop_requested():
                time.sleep(0.1)
    return status == COMPLETED


def _planned(options: argparse.Namespace, rest: Sequence[str]) -> Plan:
    """What to run, from a scenario and flags or from a run's own file."""
    if options.replay:
        if options.scenario or rest:
            received = " ".join([*filter(None, [options.scenario]), *rest])
            raise InputError(
                f"command line: expected --replay without scenario and fields, received {received}"
            )
        return replay.read(options.replay)
    if options.scenario is None:
        raise InputError(
            f"command line: expected a scenario ({', '.join(scenarios.shipped())}), received none"
        )
    scenario = scenarios.load(options.scenario, flags.overrides(rest))
    return Plan(scenario, scenario.ticks, ())


def _records(options: argparse.Namespace) -> bool:
    return bool(options.record or options.live)


def _telemetry_file(session: Session, options: argparse.Namespace) -> TelemetryFile | None:
    if not options.telemetry:
        return None
    return TelemetryFile(options.telemetry, session.signals, replay.facts(session))


def _recorder(session: Session, options: argparse.Namespace) -> Recorder:
    from spheretwin.viz.recording import Recorder  # Rerun is slow to import

    scenario = session.begun_as.model_dump(mode="json")
    recorder = Recorder(session.actuator, session.signals, scenario, path=options.record, live=options.live)
    if recorder.viewer:
        print(f"watch: {recorder.viewer.address}", file=sys.stderr, flush=True)
    return recorder


def _report(session: Session, plan: Plan, status: str, figures: Figures, options: argparse.Namespace) -> None:
    """Print the figures, and how the run ended where it did not complete."""
    scenario = session.begun_as
    summary = metrics.summary(scenario, status, figures, session.tick, session.loop_s, session.warnings())
    if options.json:
        print(json.dumps(summary, allow_nan=False), flush=True)
    else:
        tables.print_run(scenario.name, scenario.controller.law, summary)
        tables.print_files(options.record, options.telemetry)
    if status != COMPLETED:
        planned_s = plan.ticks * scenario.controller.period_s
        print(f"spheretwin: {_ending(session, status, planned_s)}", file=sys.stderr, flush=True)


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


def _check_outputs(paths: Sequence[Path]) -> None:
    """Find out before the run whether its files can be written."""
    for path in paths:
        check_writable(path)
    if len({path.resolve() for path in paths}) < len(paths):
        raise InputError(f"output: expected a path of its own for each file, received {paths[0]} twice")


def _ending(session: Session, status: str, planned_s: float) -> str:
    if session.tick == 0:
        return f"the run ended before its first tick was complete: {status}"
    angles = np.degrees(session.q_rad)
    pose = ", ".join(f"{name} {angle:.1f}°" for name, angle in zip("αβγ", angles, strict=True))
    return f"the run ended at {session.t_s:.3f} s of {planned_s:g} s: {status} ({pose})"
