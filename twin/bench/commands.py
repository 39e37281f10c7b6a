"""All commands of a bench: clients, snapshots and files, modes, time, settings and faults."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, JsonValue

from spheretwin import scenario as scenarios
from spheretwin.bench.bench_state import BenchState, Player
from spheretwin.bench.capture import Edge, Event, Trigger
from spheretwin.bench.command_queue import By, Command, Place, Text, arguments
from spheretwin.bench.driver import (
    Driver,
    Trial,
    compiled_session,
    with_end_stops,
    with_field,
)
from spheretwin.bench.folder import release
from spheretwin.bench.modes import Limits
from spheretwin.bench.operators import Operators
from spheretwin.bench.pace import FASTEST, SLOWEST
from spheretwin.loop import is_user_law
from spheretwin.models.base.errors import InputError, did_you_mean, shown
from spheretwin.models.base.files import whole_file
from spheretwin.models.base.user_code import is_reference
from spheretwin.models.telemetry.run_record import RunRecord
from spheretwin.outputs import Outputs
from spheretwin.provenance import record_of
from spheretwin.scenario import reading
from spheretwin.scenario.changes import FAULT, is_fixed
from spheretwin.scenario.sections import Scenario
from spheretwin.scenario.writing import as_toml
from spheretwin.session import Session
from spheretwin.trajectories.rounding import Triple


def _restore(bench_state: BenchState, _: None, name: str) -> None:
    end = bench_state.recording.ending(bench_state.driver.session)  # before time goes back
    bench_state.driver.restore(name)
    bench_state.resume_after_restore(end)


def _open_files(
    bench_state: BenchState, recording: str | None, telemetry: str | None, rate_Hz: float | None
) -> Callable[[], Outputs]:
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

    return open_files


def _record(bench_state: BenchState, files: Outputs, **_: Any) -> None:
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


def _keep(bench_state: BenchState, _: None) -> None:
    if not bench_state.recording.on:
        raise InputError("bench: expected a recording to keep, received none")
    bench_state.recording.end(bench_state.driver.session, None)


def _write_scenario(bench_state: BenchState, file: str) -> Callable[[], str]:
    settings = bench_state.driver.settings

    def write() -> str:
        (path,) = bench_state.folder.claim(file)
        try:
            with whole_file(path, ".toml") as temporary:
                temporary.write_text(as_toml(settings), encoding="utf-8")
        finally:
            release([path])
        return str(path)

    return write


def _save(bench_state: BenchState, path: str, file: str) -> None:
    bench_state.recording.add_completed(path)
    bench_state.note = f"written {path}"


Current = Annotated[float, Field(ge=-1e3, le=1e3)]


def _mode(method: Callable[..., None]) -> Callable[..., None]:
    """Make the action of a mode: it calls the method of the driver and ends a replay."""

    def action(bench_state: BenchState, trial: Trial | None, **given: Any) -> None:
        method(bench_state.driver, **given, **({"trial": trial} if trial else {}))
        bench_state.player = None

    return action


def _seek(bench_state: BenchState, _: None, t_s: float) -> None:
    if bench_state.player is None:
        raise InputError("bench: expected replay before seek, received none")
    bench_state.player.seek(t_s)


def _replay(bench_state: BenchState, player: Player, file: str) -> None:
    bench_state.player = player


Speed = Annotated[float, Field(ge=SLOWEST, le=FASTEST)]
Ticks = Annotated[int, Field(ge=1, le=1_000_000)]


class NewRun(NamedTuple):
    """Run that begins: settings, session, and the record of its start."""

    settings: Scenario
    session: Session
    record: RunRecord


def _new_run(settings: Scenario) -> NewRun:
    session = compiled_session(settings)
    return NewRun(settings, session, record_of(session))


def _start(bench_state: BenchState, _: None) -> None:
    bench_state.check_can_run("start")
    bench_state.running = True


def _step(bench_state: BenchState, _: None, ticks: int) -> None:
    bench_state.check_can_run("step")
    if bench_state.running:
        raise InputError("bench: expected step while paused, received it while time runs")
    bench_state.steps += ticks


def _speed(bench_state: BenchState, _: None, factor: float) -> None:
    bench_state.pace.speed = factor
    bench_state.pace.rest()


def _stop(bench_state: BenchState, _: None) -> None:
    bench_state.driver.stop(bench_state.stop_mode)
    holds = "holds, then " if bench_state.driver.mode == "hold" else ""
    bench_state.player, bench_state.note = None, f"STOP: {holds}zero currents until reset"


StopMode = Literal["off", "hold"]


def _stop_mode(bench_state: BenchState, _: None, mode: str) -> None:
    bench_state.stop_mode = mode


def _ease(bench_state: BenchState) -> None:
    """Begin with short chunks under a law of the user, which may be slower than the last one by far."""
    if is_user_law(bench_state.driver.session.law):
        bench_state.pace.ease()


def _restart(bench_state: BenchState, new_run: NewRun, **arguments: Any) -> None:
    recorded = bench_state.recording.on
    bench_state.recording.end(bench_state.driver.session, None)
    bench_state.driver.session.close()
    bench_state.begin(*new_run)
    _ease(bench_state)
    bench_state.note = "the recording has ended: the run was restarted" if recorded else None


def _present_scenario(bench_state: BenchState) -> Callable[[], NewRun]:
    return partial(_new_run, bench_state.driver.settings)


def _load_scenario(bench_state: BenchState, source: str, overrides: dict[str, Any]) -> Callable[[], NewRun]:
    def load() -> NewRun:
        return _new_run(with_end_stops(scenarios.load(*bench_state.folder.source(source, overrides))))

    return load


PositiveLimit = Annotated[float, Field(ge=1e-3, le=1e6)]

# Sections from which nothing is built or compiled.
CHEAP = ("trajectory", "disturbance")


def _limits(bench_state: BenchState, _: None, **given: float | None) -> None:
    driver = bench_state.driver
    driver.limits = Limits(*(given[field] or own for field, own in driver.limits._asdict().items()))


def _trial(bench_state: BenchState, name: str, value: Any) -> Callable[[], Trial] | None:
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

    return try_out


def _trial_of_shape(bench_state: BenchState, fields: dict[str, Any] | None) -> Callable[[], Trial] | None:
    return _trial(bench_state, "trajectory", fields) if fields else None


def _set(bench_state: BenchState, trial: Trial | None, name: str, value: Any) -> None:
    bench_state.driver.set(name, value, trial)
    _ease(bench_state)


COMMANDS: dict[str, Command] = {
    definition.name: definition
    for definition in (
        Command("start", _start, replace_equal=(), cancelled_by_stop=True),
        Command("pause", lambda bench_state, _: bench_state.pause(), replace_equal=()),
        Command("step", _step, cancelled_by_stop=True, arguments=arguments(ticks=(Ticks, 1))),
        Command("speed", _speed, replace_equal=(), arguments=arguments(factor=(Speed, ...))),
        Command("stop", _stop, by=By.ANYONE, urgent=True),
        Command(
            "stop_mode",
            _stop_mode,
            replace_equal=(),
            arguments=arguments(mode=(StopMode, ...)),
        ),
        Command("reset", _restart, replace_equal=(), prepare=_present_scenario, cancelled_by_stop=True),
        Command(
            "load",
            _restart,
            prepare=_load_scenario,
            cancelled_by_stop=True,
            arguments=arguments(source=(Text, ...), overrides=(dict[str, JsonValue], {})),
        ),
        Command(
            "snapshot",
            lambda bench_state, _, name: bench_state.driver.snapshot(name),
            arguments=arguments(name=(Text, "last")),
        ),
        Command("restore", _restore, arguments=arguments(name=(Text, "last"))),
        Command("off", _mode(Driver.off), replace_equal=()),
        Command("hold", _mode(Driver.hold), replace_equal=()),
        Command("point", _mode(Driver.point), replace_equal=(), arguments=arguments(pose_rad=(Triple, ...))),
        Command(
            "trajectory",
            _mode(Driver.trajectory),
            replace_equal=(),
            prepare=_trial_of_shape,
            arguments=arguments(fields=(dict[str, JsonValue] | None, None)),
        ),
        Command("jog", _mode(Driver.jog), replace_equal=(), arguments=arguments(rates_rad_s=(Triple, ...))),
        Command(
            "manual",
            _mode(Driver.manual),
            replace_equal=(),
            arguments=arguments(
                currents_A=(tuple[Current, ...] | None, None),
                group=(Place | None, None),
                current_A=(Current, 1.0),
            ),
        ),
        Command(
            "replay",
            _replay,
            prepare=lambda bench_state, file: lambda: Player(bench_state.folder.readable(file)),
            arguments=arguments(file=(Text, ...)),
        ),
        Command("seek", _seek, replace_equal=(), arguments=arguments(t_s=(float, ...))),
        Command(
            "limits",
            _limits,
            replace_equal=(),
            arguments=arguments(
                rate_rad_s=(PositiveLimit | None, None),
                acceleration_rad_s2=(PositiveLimit | None, None),
            ),
        ),
        Command(
            "set",
            _set,
            replace_equal=("name",),
            prepare=_trial,
            arguments=arguments(name=(Text, ...), value=(JsonValue, ...)),
        ),
        Command(
            "add_fault",
            lambda bench_state, trial, fault: _set(bench_state, trial, FAULT, fault),
            prepare=lambda bench_state, fault: _trial(bench_state, FAULT, fault),
            arguments=arguments(fault=(dict[str, JsonValue], ...)),
        ),
        Command(
            "clear_faults",
            lambda bench_state, _, place, target: bench_state.driver.clear_faults(place, target),
            arguments=arguments(place=(Place | None, None), target=(Text | None, None)),
        ),
        Command(
            "capture",
            lambda bench_state, _, **trigger: bench_state.arm(Trigger(**trigger)),
            arguments=arguments(
                on=(Event, ...),
                signal=(Text, "error_rad"),
                entry=(Place, 0),
                level=(float, 0.0),
                edge=(Edge, "rising"),
                before_s=(Annotated[float, Field(ge=0)], 0.5),
                length_s=(PositiveLimit, 2.0),
            ),
        ),
        Command(
            "record",
            _record,
            prepare=_open_files,
            arguments=arguments(
                recording=(Text | None, None),
                telemetry=(Text | None, None),
                rate_Hz=(PositiveLimit | None, None),
            ),
        ),
        Command("keep", _keep, replace_equal=()),
        Command("save", _save, prepare=_write_scenario, arguments=arguments(file=(Text, ...))),
        Command("hello", Operators.register, by=By.CLIENT),
        Command("beat", Operators.register, by=By.CLIENT),
        Command("ask", Operators.ask, by=By.CLIENT),
        Command("leave", Operators.leave, by=By.CLIENT),
        Command("grant", Operators.grant, by=By.CLIENT, arguments=arguments(to=(Text, ...))),
    )
}
"""All commands by name; `Bench` describes each."""

SIMULATED_ONLY = frozenset(
    ("pause", "step", "speed", "reset", "load", "snapshot", "restore", "replay", "seek", "add_fault")
)
"""Commands that a real machine cannot follow, or that would leave it without frames."""


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
