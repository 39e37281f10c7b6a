"""All commands of a bench, as complaints name them: a new one is said in the file of its kind, and a row."""

from __future__ import annotations

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import did_you_mean, shown
from spheretwin.twin.bench.command import Command
from spheretwin.twin.bench.commands import clients, keeping, modes, replay, run, settings

COMMANDS: dict[str, Command] = {
    command.name: command
    for command in (
        run.START,
        run.PAUSE,
        run.STEP,
        run.SPEED,
        run.STOP,
        run.RESET,
        run.LOAD,
        keeping.SNAPSHOT,
        keeping.RESTORE,
        modes.OFF,
        modes.HOLD,
        modes.POINT,
        modes.TRAJECTORY,
        modes.JOG,
        modes.MANUAL,
        replay.REPLAY,
        settings.LIMITS,
        settings.SET,
        settings.ADD_FAULT,
        settings.CLEAR_FAULTS,
        keeping.RECORD,
        keeping.KEEP,
        keeping.SAVE,
        clients.HELLO,
        clients.BEAT,
        clients.ASK,
        clients.LEAVE,
        clients.GRANT,
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
