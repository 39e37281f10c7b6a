"""All commands of a bench: clients, snapshots and files, modes, time, settings and faults."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, JsonValue

from spheretwin import scenario as scenarios
from spheretwin.bench.bench_state import BenchState, Player
from spheretwin.bench.command_queue import By, Command, Place, Text, arguments
from spheretwin.bench.driver import Driver, compiled_session, with_field
from spheretwin.bench.modes import Limits
from spheretwin.bench.operators import Operators
from spheretwin.bench.pace import FASTEST, SLOWEST
from spheretwin.models.base.errors import InputError, did_you_mean, shown
from spheretwin.models.base.files import whole_file
from spheretwin.outputs import Outputs
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
    bench_state: BenchState, recording: str | None, telemetry: str | None
) -> Callable[[], Outputs]:
    def open_files() -> Outputs:
        record, table = (Path(path) if path else None for path in (recording, telemetry))
        if not (record or table):
            raise InputError("bench: expected a file to record into, received none")
        return Outputs(bench_state.driver.session, record, table, first_tick=None)

    return open_files


def _record(bench_state: BenchState, files: Outputs, recording: str | None, telemetry: str | None) -> None:
    if bench_state.recording.on or bench_state.driver.reason is not None:
        files.close()
        raise InputError(
            "bench: expected keep before the next recording, received record"
            if bench_state.recording.on
            else "bench: expected a run in progress, received record after its end"
        )
    bench_state.recording.begin(files, bench_state.driver)


def _keep(bench_state: BenchState, _: None) -> None:
    if not bench_state.recording.on:
        raise InputError("bench: expected a recording to keep, received none")
    bench_state.recording.end(bench_state.driver.session, None)


def _write_scenario(bench_state: BenchState, file: str) -> Callable[[], None]:
    settings = bench_state.driver.settings

    def write() -> None:
        with whole_file(Path(file)) as temporary:
            temporary.write_text(as_toml(settings), encoding="utf-8")

    return write


def _save(bench_state: BenchState, _: None, file: str) -> None:
    """Do nothing more: the preparation writes the file."""


Current = Annotated[float, Field(ge=-1e3, le=1e3)]


def _mode(method: Callable[..., None]) -> Callable[..., None]:
    """Make the action of a mode: it calls the method of the driver and ends a replay."""

    def action(bench_state: BenchState, _: None, **given: Any) -> None:
        method(bench_state.driver, **given)
        bench_state.player = None

    return action


def _replay(bench_state: BenchState, player: Player, file: str) -> None:
    bench_state.player = player


Speed = Annotated[float, Field(ge=SLOWEST, le=FASTEST)]
Ticks = Annotated[int, Field(ge=1, le=1_000_000)]

NewRun = tuple[Scenario, Session]


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
    bench_state.player, bench_state.note = None, "STOP: zero currents until reset"
    bench_state.driver.stop()


def _restart(bench_state: BenchState, new_run: NewRun, **arguments: Any) -> None:
    recorded = bench_state.recording.on
    bench_state.recording.end(bench_state.driver.session, None)
    bench_state.driver.session.close()
    bench_state.begin(*new_run)
    bench_state.note = "the recording has ended: the run was restarted" if recorded else None


def _present_scenario(bench_state: BenchState) -> Callable[[], NewRun]:
    settings = bench_state.driver.settings
    return lambda: (settings, compiled_session(settings))


def _load_scenario(bench_state: BenchState, source: str, overrides: dict[str, Any]) -> Callable[[], NewRun]:
    def load() -> NewRun:
        scenario = scenarios.load(source, overrides)
        return scenario, compiled_session(scenario)

    return load


PositiveLimit = Annotated[float, Field(ge=1e-3, le=1e6)]

# Sections from which nothing is built or compiled.
CHEAP = ("trajectory", "disturbance")


def _limits(bench_state: BenchState, _: None, **given: float | None) -> None:
    driver = bench_state.driver
    driver.limits = Limits(*(given[field] or own for field, own in driver.limits._asdict().items()))


def _trial(bench_state: BenchState, name: str, value: Any) -> Callable[[], None] | None:
    """Return a trial of the new settings, the first time that a field has such a value: it may compile."""
    key = (name, value if isinstance(value, str | bool) else type(value))
    settings = bench_state.driver.settings
    cheap = name.split(".")[0] in CHEAP or key in bench_state.tried
    if cheap and not is_fixed(name):
        return None

    def try_out() -> None:
        compiled_session(with_field(settings, name, value)).close()
        bench_state.tried.add(key)

    return try_out


COMMANDS: dict[str, Command] = {
    definition.name: definition
    for definition in (
        Command("start", _start, replace_equal=(), cancelled_by_stop=True),
        Command("pause", lambda bench_state, _: bench_state.pause(), replace_equal=()),
        Command("step", _step, cancelled_by_stop=True, arguments=arguments(ticks=(Ticks, 1))),
        Command("speed", _speed, replace_equal=(), arguments=arguments(factor=(Speed, ...))),
        Command("stop", _stop, by=By.ANYONE, urgent=True),
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
            prepare=lambda bench_state, file: partial(Player, Path(file)),
            arguments=arguments(file=(Text, ...)),
        ),
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
            lambda bench_state, _, name, value: bench_state.driver.set(name, value),
            replace_equal=("name",),
            prepare=_trial,
            arguments=arguments(name=(Text, ...), value=(JsonValue, ...)),
        ),
        Command(
            "add_fault",
            lambda bench_state, _, fault: bench_state.driver.set(FAULT, fault),
            prepare=lambda bench_state, fault: _trial(bench_state, FAULT, fault),
            arguments=arguments(fault=(dict[str, JsonValue], ...)),
        ),
        Command(
            "clear_faults",
            lambda bench_state, _, place: bench_state.driver.clear_faults(place),
            arguments=arguments(place=(Place | None, None)),
        ),
        Command(
            "record",
            _record,
            prepare=_open_files,
            arguments=arguments(recording=(Text | None, None), telemetry=(Text | None, None)),
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
