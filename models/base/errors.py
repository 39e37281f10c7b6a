"""The errors this package raises: one root, so that a caller can catch them all."""

from __future__ import annotations

from spheretwin.models.base.wording import exception_text, one_line


class SpheretwinError(Exception):
    """Root of every error raised on purpose; its message is one line that any terminal can show.

    Parameters
    ----------
    message : str
        What was expected, what was received, the valid names; control characters in it are escaped, and
        values without end are shortened.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class InputError(SpheretwinError):
    """What the user gave (a scenario, a flag, a file, a law) cannot be used as it is."""


class LawError(SpheretwinError):
    """A control law raised an exception instead of writing a torque."""

    @classmethod
    def of(cls, law: str, t_s: float, error: BaseException) -> LawError:
        """Error of a law by its name, at a time, s; the exception becomes the cause."""
        made = cls(f"law {law}: expected a torque at {t_s:g} s, received {exception_text(error)}")
        made.__cause__ = error
        return made


class EngineError(SpheretwinError):
    """The physics engine reported a fault that no input explains."""
