"""The errors this package raises: one root, so that a caller can catch them all."""

from spheretwin.models.base.wording import one_line


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


class EngineError(SpheretwinError):
    """The physics engine reported a fault that no input explains."""
