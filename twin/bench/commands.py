"""What clients say of themselves: who is there, and who operates."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, JsonValue

from spheretwin import scenario as scenarios
from spheretwin.bench.bench_state import Player, Works
from spheretwin.bench.command_queue import By, Command, Place, Text, command
from spheretwin.bench.driver import Desk, with_field
from spheretwin.bench.modes import Limits
from spheretwin.bench.operators import Operators
from spheretwin.bench.pace import FASTEST, SLOWEST
from spheretwin.models.base.errors import InputError, did_you_mean, shown
from spheretwin.models.base.files import whole_file
from spheretwin.outputs import OpenedFiles
from spheretwin.scenario.changes import FAULT, is_fixed
from spheretwin.scenario.sections import Scenario
from spheretwin.scenario.writing import as_toml
from spheretwin.session import Session
from spheretwin.trajectories.rounding import Triple

HELLO = command("hello", Operators.see, by=By.CLIENT)
BEAT = command("beat", Operators.see, by=By.CLIENT)
ASK = command("ask", Operators.ask, by=By.CLIENT)
LEAVE = command("leave", Operators.leave, by=By.CLIENT)
GRANT = command("grant", Operators.grant, by=By.CLIENT, arguments={"to": (Text, ...)})


def _snapshot(works: Works, _: None, name: str) -> None:
    works.desk.snapshot(name)


def _restore(works: Works, _: None, name: str) -> None:
    end = works.recording.ending(works.desk.session)  # as it is before time goes back
    works.desk.restore(name)
    works.went_back(end)


def _opened(works: Works, recording: str | None, telemetry: str | None) -> Callable[[], OpenedFiles]:
    paths = [Path(path) if path else None for path in (recording, telemetry)]
    return lambda: OpenedFiles(works.desk.session, *paths)


def _record(works: Works, files: OpenedFiles, recording: str | None, telemetry: str | None) -> None:
    if works.recording.on or works.desk.reason is not None:
        files.discard()
        raise InputError(
            "bench: expected keep before the next recording, received record"
            if works.recording.on
            else "bench: expected a run that goes on, received record after its end"
        )
    works.recording.begin(files, works.desk)


def _keep(works: Works, _: None) -> None:
    if not works.recording.on:
        raise InputError("bench: expected a recording to keep, received none")
    works.recording.end(works.desk.session, None)


def _written(works: Works, file: str) -> Callable[[], None]:
    settings = works.desk.settings

    def write() -> None:
        with whole_file(Path(file)) as temporary:
            temporary.write_text(as_toml(settings), encoding="utf-8")

    return write


def _save(works: Works, _: None, file: str) -> None:
    """What is prepared is all of it."""


SNAPSHOT = command("snapshot", _snapshot, arguments={"name": (Text, "last")})
RESTORE = command("restore", _restore, arguments={"name": (Text, "last")})
RECORD = command(
    "record",
    _record,
    prepares=_opened,
    arguments={"recording": (Text | None, None), "telemetry": (Text | None, None)},
)
KEEP = command("keep", _keep, only_last=())
SAVE = command("save", _save, prepares=_written, arguments={"file": (Text, ...)})


Current = Annotated[float, Field(ge=-1e3, le=1e3)]


def _mode(way: Callable[..., None]) -> Callable[..., None]:
    """Go over to a mode of the desk's; a recorded run is shown no more."""

    def does(works: Works, _: None, **given: Any) -> None:
        way(works.desk, **given)
        works.player = None

    return does


OFF = command("off", _mode(Desk.off), only_last=())
HOLD = command("hold", _mode(Desk.hold), only_last=())
POINT = command("point", _mode(Desk.point), only_last=(), arguments={"pose_rad": (Triple, ...)})
TRAJECTORY = command(
    "trajectory",
    _mode(Desk.trajectory),
    only_last=(),
    arguments={"fields": (dict[str, JsonValue] | None, None)},
)
JOG = command("jog", _mode(Desk.jog), only_last=(), arguments={"rates_rad_s": (Triple, ...)})
MANUAL = command(
    "manual",
    _mode(Desk.manual),
    only_last=(),
    arguments={
        "currents_A": (tuple[Current, ...] | None, None),
        "group": (Place | None, None),
        "current_A": (Current, 1.0),
    },
)


def _read(works: Works, file: str) -> Callable[[], Player]:
    return lambda: Player(Path(file))


def _replay(works: Works, player: Player, file: str) -> None:
    works.player = player


REPLAY = command("replay", _replay, prepares=_read, arguments={"file": (Text, ...)})


Speed = Annotated[float, Field(ge=SLOWEST, le=FASTEST)]
Ticks = Annotated[int, Field(ge=1, le=1_000_000)]

Begun = tuple[Scenario, Session]


def _start(works: Works, _: None) -> None:
    works.check_going("start")
    works.running = True


def _pause(works: Works, _: None) -> None:
    works.pause()


def _step(works: Works, _: None, ticks: int) -> None:
    works.check_going("step")
    if works.running:
        raise InputError("bench: expected step while paused, received it while time goes on")
    works.steps += ticks


def _speed(works: Works, _: None, factor: float) -> None:
    works.pace.speed = factor
    works.pace.rest()


def _stop(works: Works, _: None) -> None:
    works.player, works.note = None, "STOP: currents are taken away until reset"
    works.desk.stop()


def _begun_anew(works: Works, ready: Begun, **given: Any) -> None:
    recorded = works.recording.on
    works.recording.end(works.desk.session, None)
    works.desk.session.close()
    works.begin(*ready)
    works.note = "the recording has ended: the run was begun anew" if recorded else None


def _present(works: Works) -> Callable[[], Begun]:
    settings = works.desk.settings
    return lambda: (settings, Session(settings))


def _another(works: Works, source: str, overrides: dict[str, Any]) -> Callable[[], Begun]:
    def load() -> Begun:
        scenario = scenarios.load(source, overrides)
        return scenario, Session(scenario)

    return load


START = command("start", _start, only_last=(), undone=True)
PAUSE = command("pause", _pause, only_last=())
STEP = command("step", _step, undone=True, arguments={"ticks": (Ticks, 1)})
SPEED = command("speed", _speed, only_last=(), arguments={"factor": (Speed, ...)})
STOP = command("stop", _stop, by=By.ANYONE, before_all=True)
RESET = command("reset", _begun_anew, only_last=(), prepares=_present, undone=True)
LOAD = command(
    "load",
    _begun_anew,
    prepares=_another,
    undone=True,
    arguments={"source": (Text, ...), "overrides": (dict[str, JsonValue], {})},
)


PositiveLimit = Annotated[float, Field(ge=1e-3, le=1e6)]

# Sections whose fields no machine is built from.
CHEAP = ("trajectory", "disturbance")


def _limits(works: Works, _: None, **given: float | None) -> None:
    desk = works.desk
    desk.limits = Limits(*(given[field] or own for field, own in desk.limits._asdict().items()))


def _set(works: Works, _: None, name: str, value: Any) -> None:
    works.desk.set(name, value)


def _add_fault(works: Works, _: None, fault: dict[str, Any]) -> None:
    works.desk.set(FAULT, fault)


def _clear_faults(works: Works, _: None, place: int | None) -> None:
    works.desk.clear_faults(place)


def _trial(works: Works, name: str, value: Any) -> Callable[[], None] | None:
    """A session of the settings to be, the first time that a field is set so: it may be compiled."""
    key = (name, value if isinstance(value, str | bool) else type(value))
    settings = works.desk.settings
    cheap = name.split(".")[0] in CHEAP or key in works.tried
    if cheap and not is_fixed(name):
        return None

    def try_out() -> None:
        Session(with_field(settings, name, value)).close()
        works.tried.add(key)

    return try_out


def _trial_of_fault(works: Works, fault: dict[str, Any]) -> Callable[[], None] | None:
    return _trial(works, FAULT, fault)


LIMITS = command(
    "limits",
    _limits,
    only_last=(),
    arguments={
        "rate_rad_s": (PositiveLimit | None, None),
        "acceleration_rad_s2": (PositiveLimit | None, None),
    },
)
SET = command(
    "set",
    _set,
    only_last=("name",),
    prepares=_trial,
    arguments={"name": (Text, ...), "value": (JsonValue, ...)},
)
ADD_FAULT = command(
    "add_fault", _add_fault, prepares=_trial_of_fault, arguments={"fault": (dict[str, JsonValue], ...)}
)
CLEAR_FAULTS = command("clear_faults", _clear_faults, arguments={"place": (Place | None, None)})


COMMANDS: dict[str, Command] = {
    command.name: command
    for command in (
        START,
        PAUSE,
        STEP,
        SPEED,
        STOP,
        RESET,
        LOAD,
        SNAPSHOT,
        RESTORE,
        OFF,
        HOLD,
        POINT,
        TRAJECTORY,
        JOG,
        MANUAL,
        REPLAY,
        LIMITS,
        SET,
        ADD_FAULT,
        CLEAR_FAULTS,
        RECORD,
        KEEP,
        SAVE,
        HELLO,
        BEAT,
        ASK,
        LEAVE,
        GRANT,
    )
}
"""By name; see `Bench` for what each does."""


def named(name: object) -> Command:
    """Command of a name.

    Raises
    ------
    InputError
        There is none.
    """
    if not isinstance(name, str) or name not in COMMANDS:
        raise InputError(
            f"bench: expected one of {', '.join(COMMANDS)}, received {shown(name)}"
            f"{did_you_mean(str(name), COMMANDS)}"
        )
    return COMMANDS[name]
