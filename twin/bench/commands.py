"""All commands of a bench: clients, snapshots and files, modes, time, settings and faults.

The signature of a function states the arguments of its command, its docstring the text, and its decorator who
may give the command and how it waits.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial, wraps
from typing import Annotated, Any, Literal

from pydantic import Field, JsonValue

from spheretwin import scenario as scenarios
from spheretwin.bench.bench_state import BenchState, Player
from spheretwin.bench.command_queue import By, Command, Place, Text, Work, command_of
from spheretwin.bench.driver import Driver, Trial, compiled_session, with_end_stops, with_field
from spheretwin.bench.folder import release
from spheretwin.bench.history import Edge, Event, Trigger
from spheretwin.bench.modes import Limits
from spheretwin.bench.operators import Operators
from spheretwin.bench.pace import FASTEST, SLOWEST
from spheretwin.loop.closed_loop import is_user_law
from spheretwin.models.base.errors import InputError, did_you_mean, shown
from spheretwin.models.base.files import whole_file
from spheretwin.models.base.user_code import is_reference
from spheretwin.models.telemetry.run_record import RunRecord
from spheretwin.records.outputs import Outputs
from spheretwin.records.provenance import record_of
from spheretwin.scenario import reading
from spheretwin.scenario.changes import FAULT, is_fixed
from spheretwin.scenario.sections import Scenario
from spheretwin.scenario.writing import as_toml
from spheretwin.session import Session

COMMANDS: dict[str, Command] = {}
"""All commands by name."""

Action = Callable[..., Any]
Steps = Generator[Work, Any, None]
Speed = Annotated[float, Field(ge=SLOWEST, le=FASTEST)]
Ticks = Annotated[int, Field(ge=1, le=1_000_000)]
PositiveLimit = Annotated[float, Field(ge=1e-3, le=1e6)]
Json = dict[str, JsonValue]

# Sections from which nothing is built or compiled.
CHEAP = ("trajectory", "disturbance")

_NO_FIELDS: Json = {}


def _command(name: str = "", **settings: Any) -> Callable[[Action], Action]:
    """Return a decorator that makes a function a command of its name."""

    def add(action: Action) -> Action:
        command = command_of(name or action.__name__.strip("_"), action, **settings)
        COMMANDS[command.name] = command
        return action

    return add


_latest = partial(_command, replace_equal=())
"""Like `_command`; a later command replaces one that waits."""


def _of_driver(method: Action) -> Action:
    """Make the action of a method of the driver."""
    return wraps(method)(lambda bench_state, **given: method(bench_state.driver, **given))


def _mode(method: Action) -> Action:
    """Make the action of a mode from a method of the driver; it ends a replay."""

    @wraps(method)
    def action(bench_state: BenchState, **given: Any) -> None:
        bench_state.driver.check_available(method.__name__)
        method(bench_state.driver, **given)
        bench_state.player = None

    return action


@_latest(cancelled_by_stop=True)
def _start(bench_state: BenchState) -> None:
    """Run the time."""
    bench_state.check_can_run("start")
    bench_state.running = True


_latest(simulated_only=True)(BenchState.pause)


@_command(cancelled_by_stop=True, simulated_only=True)
def _step(bench_state: BenchState, ticks: Ticks = 1) -> None:
    """While paused: run this many control ticks."""
    bench_state.check_can_run("step")
    if bench_state.running:
        raise InputError("bench: expected step while paused, received it while time runs")
    bench_state.steps += ticks


@_latest(simulated_only=True)
def _speed(bench_state: BenchState, factor: Speed) -> None:
    """Set the pace, 0.1 to as fast as possible (1e6); 1 is that of the clock."""
    bench_state.pace.speed = factor
    bench_state.pace.rest()


@_command(by=By.ANYONE, urgent=True)
def _stop(bench_state: BenchState) -> None:
    """STOP: currents to zero, latched until ``reset``."""
    bench_state.driver.stop(bench_state.stop_mode)
    holds = "holds, then " if bench_state.driver.mode == "hold" else ""
    bench_state.player, bench_state.note = None, f"STOP: {holds}zero currents until reset"


@_latest()
def _stop_mode(bench_state: BenchState, mode: Literal["off", "hold"]) -> None:
    """Set what STOP does: ``off``: zero currents; ``hold``: hold until the rotor rests, then these."""
    bench_state.stop_mode = mode


NewRun = tuple[Scenario, Session, RunRecord]
"""Run that begins: settings, session, and the record of its start."""


def _new_run(settings: Scenario) -> NewRun:
    session = compiled_session(settings)
    return settings, session, record_of(session)


def _restart(bench_state: BenchState, run: NewRun) -> None:
    recorded = bench_state.recording.on
    bench_state.recording.end(bench_state.driver.session, None)
    bench_state.driver.session.close()
    bench_state.begin(*run)
    _ease(bench_state)
    bench_state.note = "the recording has ended: the run was restarted" if recorded else None


def _ease(bench_state: BenchState) -> None:
    """Begin with short chunks under a law of the user, which may be slower than the last one by far."""
    if is_user_law(bench_state.driver.session.law):
        bench_state.pace.ease()


@_latest(cancelled_by_stop=True, simulated_only=True)
def _reset(bench_state: BenchState) -> Steps:
    """Return to tick 0 of the present settings and the pending ones; paused."""
    _restart(bench_state, (yield partial(_new_run, bench_state.driver.settings)))


@_command(cancelled_by_stop=True, simulated_only=True)
def _load(bench_state: BenchState, source: Text, overrides: Json = _NO_FIELDS) -> Steps:
    """Go to tick 0 of another scenario, by name or file; paused."""

    def load() -> NewRun:
        return _new_run(with_end_stops(scenarios.load(*bench_state.folder.source(source, overrides))))

    _restart(bench_state, (yield load))


_command(simulated_only=True)(_of_driver(Driver.snapshot))


@_command(simulated_only=True)
def _restore(bench_state: BenchState, name: Text = "last") -> None:
    """Return to a snapshot."""
    end = bench_state.recording.ending(bench_state.driver.session)  # before time goes back
    bench_state.driver.restore(name)
    bench_state.resume_after_restore(end)


_MODES: tuple[Action, ...] = (Driver.off, Driver.hold, Driver.point, Driver.jog, Driver.manual)

for _method in _MODES[:3]:
    _latest()(_mode(_method))


@_latest()
def _trajectory(bench_state: BenchState, fields: Json | None = None) -> Steps:
    """Follow ``{"shape": "sinusoid", ...}``; default: the last one."""
    trial = (yield from _trial(bench_state, "trajectory", fields)) if fields else None
    bench_state.driver.check_available("trajectory")
    bench_state.driver.trajectory(fields, trial)
    bench_state.player = None


for _method in _MODES[3:]:
    _latest()(_mode(_method))


@_command(simulated_only=True)
def _replay(bench_state: BenchState, file: Text) -> Steps:
    """Show the rows of a recorded run; the twin is paused meanwhile, and any mode ends the replay."""
    bench_state.player = yield lambda: Player(bench_state.folder.readable(file))


@_latest(simulated_only=True)
def _seek(bench_state: BenchState, t_s: float) -> None:
    """Show the row of the replay at a time."""
    if bench_state.player is None:
        raise InputError("bench: expected replay before seek, received none")
    bench_state.player.seek(t_s)


@_latest()
def _limits(
    bench_state: BenchState,
    rate_rad_s: PositiveLimit | None = None,
    acceleration_rad_s2: PositiveLimit | None = None,
) -> None:
    """Limit the approach to a pose or a shape."""
    own = bench_state.driver.limits
    bench_state.driver.limits = Limits(
        rate_rad_s or own.rate_rad_s, acceleration_rad_s2 or own.acceleration_rad_s2
    )


def _trial(bench_state: BenchState, name: str, value: Any) -> Generator[Work, Any, Trial | None]:
    """Return a trial of the new settings, if it may read files, run code of the user, or compile.

    A shipped loop is compiled the first time that a field has such a value.
    """
    key = (name, value if isinstance(value, str | bool) else type(value))
    settings, section = bench_state.driver.settings, name.split(".")[0]
    cheap = section in CHEAP or (key in bench_state.tried and not is_reference(settings.controller.law))
    names_files = any(reading.named_files(reading.single_field(name, value)))
    if cheap and not is_fixed(name) and not names_files:
        return None

    def try_out() -> Trial:
        setting = bench_state.folder.value(name, value)
        after = with_field(settings, name, setting)
        trial = Trial(setting, settings, after, compiled_session(after))
        bench_state.tried.add(key)
        return trial

    trial: Trial = yield try_out
    return trial


@_command(replace_equal=("name",))
def _set(bench_state: BenchState, name: Text, value: JsonValue) -> Steps:
    """Set any field of the scenario, dotted; fixed ones wait for ``reset``."""
    trial = yield from _trial(bench_state, name, value)
    bench_state.driver.set(name, value, trial)
    _ease(bench_state)


@_command(simulated_only=True)
def _add_fault(bench_state: BenchState, fault: Json) -> Steps:
    """Add a fault, as ``{"target": "coil.07", "mode": "open"}``; default start: now."""
    return _set(bench_state, FAULT, fault)


_command()(_of_driver(Driver.clear_faults))


@_command()
def _capture(
    bench_state: BenchState,
    on: Event,
    signal: Text = "error_rad",
    entry: Place = 0,
    level: float = 0.0,
    edge: Edge = "rising",
    before_s: Annotated[float, Field(ge=0)] = 0.5,
    length_s: PositiveLimit = 2.0,
) -> None:
    """Keep every row around the next event: ``level``, ``fault`` or ``saturation``; ``off`` for none.

    `captured` returns them.
    """
    bench_state.arm(Trigger(on, signal, entry, level, edge, before_s, length_s))


@_command()
def _record(
    bench_state: BenchState,
    recording: Text | None = None,
    telemetry: Text | None = None,
    rate_Hz: PositiveLimit | None = None,
) -> Steps:
    """Write .rrd and .parquet from now on; an existing name is numbered.

    The .rrd has all rows, or some a second, extremes and events.
    """
    _check_can_record(bench_state)

    def open_files() -> Outputs:
        names = [path for path in (recording, telemetry) if path]
        if not names:
            raise InputError("bench: expected a file to record into, received none")
        session = bench_state.driver.session
        highest_Hz = 1 / session.scenario.controller.period_s
        if rate_Hz is not None and rate_Hz > highest_Hz * (1 + 1e-9):  # both are rounded
            raise InputError(
                f"bench: expected rate_Hz of at most {highest_Hz:g}, the rate of the controller, received"
                f" {rate_Hz:g}"
            )
        paths = bench_state.folder.claim(*names)
        record, table = paths[0] if recording else None, paths[-1] if telemetry else None
        try:
            return Outputs(session, record, table, first_tick=None, record_rate_Hz=rate_Hz)
        except BaseException:
            release(paths)
            raise

    files: Outputs = yield open_files
    try:
        _check_can_record(bench_state)
    except InputError:
        files.close()
        release(files.paths)
        raise
    bench_state.recording.begin(files, bench_state.driver)


def _check_can_record(bench_state: BenchState) -> None:
    if bench_state.recording.on:
        raise InputError("bench: expected keep before the next recording, received record")
    if bench_state.driver.reason is not None:
        raise InputError("bench: expected a run in progress, received record after its end")


@_latest()
def _keep(bench_state: BenchState) -> None:
    """End the recording, and complete the files."""
    if not bench_state.recording.on:
        raise InputError("bench: expected a recording to keep, received none")
    bench_state.recording.end(bench_state.driver.session, None)


@_command()
def _save(bench_state: BenchState, file: Text) -> Steps:
    """Write the present settings as a scenario (TOML)."""
    settings = bench_state.driver.settings

    def write() -> str:
        (path,) = bench_state.folder.claim(file)
        try:
            with whole_file(path, ".toml") as temporary:
                temporary.write_text(as_toml(settings), encoding="utf-8")
        finally:
            release([path])
        return str(path)

    path: str = yield write
    bench_state.recording.add_completed(path)
    bench_state.note = f"written {path}"


for _name, _about_client in (
    ("hello", Operators.register),
    ("beat", Operators.register),
    ("ask", Operators.ask),
    ("leave", Operators.leave),
    ("grant", Operators.grant),
):
    _command(_name, by=By.CLIENT)(_about_client)


def find_command(name: object) -> Command:
    """Return the command of a name.

    Raises
    ------
    InputError
        No command has this name.
    """
    if not isinstance(name, str) or name not in COMMANDS:
        raise InputError(
            f"bench: expected one of {', '.join(COMMANDS)}, received {shown(name)}"
            f"{did_you_mean(str(name), COMMANDS)}"
        )
    return COMMANDS[name]


def documentation() -> str:
    """Return the list of all commands, with arguments and texts, as reStructuredText."""
    heads = {name: ", ".join([f"``{name}``", *command.parameters]) for name, command in COMMANDS.items()}
    return "\n".join(f"{head}\n    {COMMANDS[name].text}" for name, head in heads.items())
