"""``spheretwin bench SCENARIO``: drive the running twin from a browser."""

from __future__ import annotations

import argparse
import contextlib
import math
import sys
import warnings
import webbrowser
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.bench import Bench
from spheretwin.twin.bench.operators import GONE_s, Operators
from spheretwin.twin.commands import outputs
from spheretwin.twin.commands.interruption import interruptible
from spheretwin.twin.scenario import flags
from spheretwin.twin.scenario.reading import shipped
from spheretwin.viz.terminal import tables

PORT = 8080

EXAMPLE = "hold"

LARGEST_PORT = 65_535

# A page that is closed says so at once; this process may be silent itself while something is compiled.
SILENCE_S = 10.0


def add_to(verbs: Any) -> None:
    """Add the verb to the command's parser."""
    parser = verbs.add_parser(
        "bench",
        help="drive the running twin from a browser",
        description="Drive the running twin from a browser. Any field of the scenario is a flag",
        usage="spheretwin bench [SCENARIO] [options] [--section.field VALUE ...]",
        allow_abbrev=False,
    )
    parser.add_argument(
        "scenario",
        metavar="SCENARIO",
        nargs="?",
        default=EXAMPLE,
        help=f"{', '.join(shipped())}, or a .toml file; {EXAMPLE} unless given",
    )
    parser.add_argument(
        "--port",
        type=_port,
        default=PORT,
        metavar="P",
        help=f"of the page, on 127.0.0.1; {PORT} unless given, 0 for any that is free",
    )
    parser.add_argument("--no-browser", action="store_true", help="only say where the page is")
    parser.add_argument(
        "--hold-after",
        type=_seconds,
        default=GONE_s,
        metavar="S",
        help=f"how long the twin goes on after the page that operates it is gone; {GONE_s:g} s unless given",
    )
    parser.add_argument("--record", type=Path, metavar="FILE.rrd", help="record from the start")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the verb until it is interrupted; True when what was recorded is whole."""
    if find_spec("viser") is None:
        raise InputError(
            "bench: expected viser, which the extra bench brings: pip install 'spheretwin[bench]'"
        )
    scenario = scenarios.load(options.scenario, flags.overrides(rest))
    outputs.check([options.record] if options.record else [])
    # Slow to import, and only a bench needs it.
    from spheretwin.twin.commands.benching.choices import choices_of
    from spheretwin.viz.bench import front
    from spheretwin.viz.bench.page import Page

    # It warns of what it has to say to pages that are gone.
    warnings.filterwarnings("ignore", category=UserWarning, module=r"viser\b")
    listening = front.listen(options.port)  # before anything is compiled
    print(f"bench: preparing {scenario.name}", file=sys.stderr, flush=True)  # it may have to be compiled
    with listening, interruptible() as stop_requested, contextlib.ExitStack() as stack:
        stack.enter_context(timers_stopped())
        bench = stack.enter_context(Bench(scenario, Operators(options.hold_after, SILENCE_S)))
        page = stack.enter_context(Page(bench, choices_of(bench), listening))
        bench.begin()
        _record(bench, options.record)
        print(f"bench: {page.address} (Ctrl-C ends it)", flush=True)
        if not options.no_browser:
            webbrowser.open(page.address)
        page.show(stop_requested)
    return _told(bench)


def _port(text: str) -> int:
    if not (text.isascii() and text.isdecimal()) or len(text) > 5 or int(text) > LARGEST_PORT:
        raise argparse.ArgumentTypeError(f"expected a port from 0 to {LARGEST_PORT}, received {text}")
    return int(text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 <= seconds < math.inf:
        raise argparse.ArgumentTypeError(f"expected a time from 0 s on, received {text}")
    return seconds


def _record(bench: Bench, recording: Path | None) -> None:
    if recording and (refused := bench.command("record", recording=str(recording)).wait()):
        raise InputError(refused)


def _told(bench: Bench) -> bool:
    """Name what was kept, and say what went wrong with a recording; True where nothing did."""
    state = bench.state()
    tables.print_written([Path(file) for file in state.kept])
    if state.recording:
        print(f"spheretwin: not completed: {', '.join(state.recording)}", file=sys.stderr)
    return not state.recording
