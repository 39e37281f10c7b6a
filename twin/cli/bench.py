"""``spheretwin bench``: interactive twin, and the fields that its page offers."""

from __future__ import annotations

import argparse
import contextlib
import shlex
import sys
import tempfile
import warnings
import webbrowser
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.bench.folder import Folder, FolderFiles
from spheretwin.bench.modes import Limits
from spheretwin.bench.operators import GONE_s, Operators
from spheretwin.cli.common import interruptible, print_message, warn
from spheretwin.cli.drive import LIMITS, LINK, limited_rate, open_link
from spheretwin.cli.machine import FRAME, STANDARD_STREAMS
from spheretwin.cli.options import READERS, from_zero, number, verb
from spheretwin.control.laws import LAWS
from spheretwin.faults.targets import TARGETS
from spheretwin.machine.link.controller_scenario import left_out
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.extras import missing
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.models.telemetry.joint_state_server import published
from spheretwin.records import outputs
from spheretwin.scenario import reading
from spheretwin.scenario.fields import families, without_indices
from spheretwin.scenario.reading import shipped, value_text
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session
from spheretwin.trajectories import SHAPES
from spheretwin.viz.bench.protocols import Choices, FieldSetting
from spheretwin.viz.terminal import runs

# Numbers of the controller that are not gains.
NO_GAINS = ("controller.period_s",)

# Fields of a shape that the page does not offer: its name, and the approach, which the bench computes.
NO_SHAPE = ("shape", "approach")


def choices_of(bench: Bench, folder: Path | None = None) -> Choices:
    """Return the choices of the page of a bench, with the files of a folder; default: the working folder."""
    files = FolderFiles(folder or Path())
    groups = len(bench.actuator.groups)
    return Choices(
        settings=lambda: settings_of(bench.fields()),
        shape=lambda name: shape_settings(name, bench),
        read=read,
        scenarios=lambda: [*shipped(), *files.scenarios()],
        shapes=tuple(SHAPES),
        laws=lambda: [*LAWS, *files.laws()],
        runs=files.runs,
        limits=Limits(),
        targets={name: tuple(target.modes) for target in TARGETS.values() for name in target.names(groups)},
    )


def settings_of(fields: list[tuple[str, Any, FieldInfo]]) -> list[FieldSetting]:
    """Return the fields of a run with their valid values."""
    return [_setting(*field) for field in fields]


def shape_settings(name: str, bench: Bench) -> list[FieldSetting]:
    """Return the fields of a shape: present values for the active shape, defaults for another."""
    kind, present = SHAPES.get(name), bench.trajectory.model_dump()
    if kind is None:
        return []
    known = present if present["shape"] == name else {}
    return [
        FieldSetting(
            field,
            value_text(known.get(field, _default(info)), exact=True),
            _default_text(info),
            _meaning(info),
            _literals(info.annotation),
        )
        for field, info in kind.model_fields.items()
        if field not in NO_SHAPE
    ]


def read(name: str, text: str) -> Any:
    """Return the value of a text, as the command line reads it; None for an empty text.

    Raises
    ------
    InputError
        A quotation mark is not closed.
    """
    text = text.strip()
    if not text:
        return None
    try:
        tokens = [text] if text[0] in "[{" else shlex.split(text)
    except ValueError as error:
        raise InputError(f"{name}: expected a value, received {text}: {error}") from None
    if any(token.startswith("--") for token in tokens):
        raise InputError(f"{name}: expected a value, received {text}")
    if name == "controller.law":  # as a flag, a file would be run now, in the thread that serves the pages
        return " ".join(tokens)
    return reading.overrides([f"--{name}", *tokens])[name]


def _setting(name: str, value: Any, field: FieldInfo) -> FieldSetting:
    choices = families(Scenario).get(without_indices(name)) or _literals(field.annotation)
    limits = _range(name, value, field)
    return FieldSetting(
        name, value_text(value, exact=True), _default_text(field), _meaning(field), choices, limits
    )


def _range(name: str, value: Any, field: FieldInfo) -> tuple[float, float] | None:
    """Return the range of a gain's slider, from its bound to four times its default; else None."""
    numbers = value if isinstance(value, tuple) else (value,)
    is_gain = name.startswith("controller.") and name.count(".") == 1 and name not in NO_GAINS
    if not is_gain or not numbers or not all(type(number) in (int, float) for number in numbers):
        return None
    default = _default(field)
    defaults = default if isinstance(default, tuple) else (default,)
    largest = max((abs(number) for number in defaults if isinstance(number, int | float)), default=0.0)
    bounds = dict(_bounds(field))
    low = float(bounds.get("ge", bounds.get("gt", 0.0)))
    high = 4 * largest or 1.0
    return low, min([high, *(float(bounds[sign]) for sign in ("le", "lt") if sign in bounds)])


def _default(field: FieldInfo) -> Any:
    default = field.get_default(call_default_factory=True, validated_data={})
    return None if default is PydanticUndefined or isinstance(default, BaseModel) else default


def _default_text(field: FieldInfo) -> str | None:
    return None if field.is_required() else value_text(_default(field), exact=True)


SIGNS = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}


def _meaning(field: FieldInfo) -> str:
    bounds = [f"{SIGNS[sign]} {bound:g}" for sign, bound in _bounds(field)]
    return ", ".join([field.description or "", *dict.fromkeys(bounds)])


def _bounds(field: FieldInfo) -> Iterator[tuple[str, Any]]:
    """Yield the bounds of a field, or of the numbers in it."""
    for mark in (*field.metadata, *_marks(field.annotation)):
        for sign in SIGNS:
            if hasattr(mark, sign):
                yield sign, getattr(mark, sign)


def _marks(annotation: Any) -> Iterator[Any]:
    for inside in (*get_args(annotation), *getattr(annotation, "__metadata__", ())):
        yield from inside.metadata if isinstance(inside, FieldInfo) else _marks(inside)


def _literals(annotation: Any) -> tuple[str, ...]:
    if get_origin(annotation) is Literal:
        return tuple(option for option in get_args(annotation) if isinstance(option, str))
    return ()


PORT = 8080

EXAMPLE = "bench"


@verb(
    f"""
    [SCENARIO]={EXAMPLE}  {", ".join(shipped())}, or a .toml file; {EXAMPLE} unless given
    --port P={PORT}     port of the page, on 127.0.0.1; {PORT} unless given, 0 for any free port
    --no-browser      only print the address of the page
    --hold-after S={GONE_s:g}  time for which the twin continues after its page is closed; {GONE_s:g} s
        unless given
    --record FILE.rrd  record from the start
    --publish PORT    publish data for Foxglove and ROS 2
    --folder DIR      files that the page names are below it; the working folder unless given
    --machine ADDRESS  drive a machine at udp://HOST:PORT or serial:DEVICE@BAUD, with the options of
        `drive`: --arm, --frame, --limit-angle-deg, …
    """,
    has_fields=True,
    port=READERS["PORT"],
    hold_after=number("a time from 0 s on", from_zero),
    folder={"type": Path, "default": Path()},
    usage="[SCENARIO]",
    needs={"--arm": "--machine"},
    unlisted=LINK + FRAME,
    **LIMITS,
)
def run(options: argparse.Namespace) -> bool:
    """Drive the running twin from a browser.

    Any field of the scenario is a flag
    """
    if find_spec("viser") is None:
        raise missing("bench", "viser", "bench")
    scenario = scenarios.load(options.scenario, reading.overrides(options.fields))
    scenario = limited_rate(scenario, options.limit_rate_rad_s)
    recordings = [options.record.resolve()] if options.record else []
    outputs.check(options.record, None)
    folder = Folder(options.folder, scenario, recordings)
    # viser may be missing.
    from spheretwin.viz.bench import server
    from spheretwin.viz.bench.page import Page

    # viser warns of messages to closed pages.
    warnings.filterwarnings("ignore", category=UserWarning, module=r"viser\b")
    listening = server.listen(options.port)  # before anything is compiled
    print(f"bench: preparing {scenario.name}", file=sys.stderr, flush=True)  # it may have to be compiled
    with listening, interruptible() as stop_requested, contextlib.ExitStack() as stack:
        stack.enter_context(timers_stopped())
        machine = stack.enter_context(_machine(options, scenario, stop_requested))
        publishers = stack.enter_context(published(options.publish))
        operators = Operators(options.hold_after)
        bench = stack.enter_context(Bench(scenario, operators, folder, machine, publishers))
        page = stack.enter_context(Page(bench, choices_of(bench, options.folder), listening))
        bench.begin()
        _record(bench, recordings)
        address = page.address
        print(f"bench: {address} (Ctrl-C ends it)", flush=True)
        if not options.no_browser:
            stack.enter_context(_browser(address))
        page.show(_announced(page, address, stop_requested))
    return _report(bench)


@contextlib.contextmanager
def _machine(
    options: argparse.Namespace, scenario: Scenario, stop_requested: Callable[[], bool]
) -> Iterator[Session | None]:
    """Connect to the machine of the command line, and yield a session with it as the plant; None without."""
    if options.machine is None:
        yield None
        return
    if options.machine == STANDARD_STREAMS:
        raise InputError("command line: expected --machine with udp:// or serial:, received -")
    warn(left_out(scenario))
    with open_link(options, scenario, stop_requested) as link:
        yield link.session(scenario)


def _record(bench: Bench, recordings: list[Path]) -> None:
    for recording in recordings:
        bench.do("record", recording=str(recording))


@contextlib.contextmanager
def _browser(address: str) -> Iterator[None]:
    """Open an address in the browser, by a file that only this account can read.

    The command line of a browser is visible to all accounts of the machine.
    """
    try:
        descriptor, name = tempfile.mkstemp(prefix="bench-", suffix=".html", dir=Path.home())
    except (OSError, RuntimeError):  # no home that can be written: the address is printed
        yield
        return
    try:
        with open(descriptor, "w", encoding="utf-8") as file:
            file.write(f'<meta http-equiv="refresh" content="0; url={address}">')
        webbrowser.open(Path(name).as_uri())
        yield
    finally:
        Path(name).unlink(missing_ok=True)


def _announced(page: Any, address: str, ended: Callable[[], bool]) -> Callable[[], bool]:
    """Return `ended`, which also prints the address for the next browser once one has used the last one."""

    def announce() -> bool:
        nonlocal address
        if page.address != address:
            address = page.address
            print(f"bench: for another browser: {address}", flush=True)
        return ended()

    return announce


def _report(bench: Bench) -> bool:
    """Print the written files and what failed; return True if nothing did."""
    state = bench.state()
    runs.print_written([Path(file) for file in state.completed_files])
    if state.recording:
        print_message(f"not completed: {', '.join(state.recording)}")
    if bench.stalled:
        print_message(f"{state.reason}")
    return not (state.recording or bench.stalled)
