"""How a run stands: one row for each status, with the code that compiled loops return and what a log says."""

from __future__ import annotations

from enum import StrEnum

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import did_you_mean, shown


class Level(StrEnum):
    """How much a line of a log matters."""

    INFO = "INFO"
    WARN = "WARN"
    ERROR = "ERROR"


class Status(StrEnum):
    """Where a run is, or how it ended; equal to its own name as text.

    Attributes
    ----------
    level : Level
        How much it matters to whoever reads the log.
    told : str
        What the log says of it.
    code : int or None
        What the loop returns for it; None where the loop cannot know of it.
    """

    level: Level
    told: str
    code: int | None

    def __new__(cls, name: str, level: Level, told: str, code: int | None = None) -> Status:
        """Text with its row."""
        status = str.__new__(cls, name)
        status._value_ = name
        status.level, status.told, status.code = level, told, code
        return status

    RUNNING = "running", Level.INFO, "the run goes on", 0
    COMPLETED = "completed", Level.INFO, "the run is complete"
    LEFT_WORKSPACE = (
        "left_workspace",
        Level.ERROR,
        "a hinge reached the end of its range: the run ends here",
        1,
    )
    DIVERGED = (
        "diverged",
        Level.ERROR,
        "a torque or the motion lost its number or its bounds: the run ends here",
        2,
    )
    FAILSAFE = "failsafe", Level.ERROR, "the amplifiers were switched off for safety: the run ends here", 3
    INTERRUPTED = "interrupted", Level.WARN, "the run was interrupted"


BY_CODE = {status.code: status for status in Status if status.code is not None}
"""Status for what the loop returns."""


def named(name: str) -> Status:
    """Status of a name, as a file keeps it.

    Raises
    ------
    InputError
        There is none of this name.
    """
    for status in Status:
        if status == name:
            return status
    raise InputError(
        f"status: expected one of {', '.join(Status)}, received {shown(name)}{did_you_mean(name, Status)}"
    )
