"""The errors this package raises: one root, so that a caller can catch them all."""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Iterable
from itertools import islice

import numpy as np

# A path or a name of everyday length stays whole; digits by the thousand do not.
LONGEST_VALUE, LONGEST_WORD, LONGEST_LINE = 120, 300, 2000

# Entries and levels of a list or a table beyond which its text is cut in any case.
MOST_ENTRIES, DEEPEST = 60, 10

FEWEST_DIGITS, MOST_DIGITS = 6, 17  # 17 significant digits tell any two floats apart


def one_line(text: str) -> str:
    """A message as a terminal can show it: one line, no control characters, nothing without end.

    Line breaks, escape sequences and whatever else cannot be printed appear as Python's own `ascii` writes
    them. What is too long keeps both its ends.
    """
    printable = "".join(
        character if character.isprintable() else ascii(character)[1:-1] for character in text
    )
    return shortened(" ".join(shortened(word, LONGEST_WORD) for word in printable.split(" ")), LONGEST_LINE)


def without_breaks(error: BaseException) -> str:
    """Return the message of another library's error on one line, without numbers and names of Python."""
    match error:
        case UnicodeDecodeError():
            return "it is not text in UTF-8"
        case RecursionError():
            return "it is nested too deeply"
        case OSError() if error.strerror:
            named = error.filename if error.filename2 is None else error.filename2
            return error.strerror if named is None else f"{error.strerror}: {named}"
    return " ".join(str(error).split())


def exception_text(error: BaseException) -> str:
    """Type and message of an exception, as ``ValueError: lost``; the type alone if there is no message."""
    message = without_breaks(error)
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def shortened(text: str, longest: int) -> str:
    """A text of at most `longest` characters, its middle left out where it is longer."""
    if len(text) <= longest:
        return text
    head = (longest - 1) // 2
    return f"{text[:head]}…{text[head + 1 - longest :]}"


def shown(value: object) -> str:
    """Return what was received as JSON or TOML write it: on one line, and not without end.

    What neither of them has is written as Python writes it.
    """
    try:
        text = _written(value)
    except ValueError:  # an integer of more digits than Python writes
        return "a number of too many digits"
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # an object of the user's, which may raise anything
        return (
            f"a value of class {type(value).__name__}, which raises {type(error).__name__} when it is written"
        )
    return shortened(" ".join(line.strip() for line in text.splitlines()), LONGEST_VALUE)


def _written(value: object, above: tuple[int, ...] = ()) -> str:
    """Text of a value; what is nested too deeply is left out, and so is what is behind many entries.

    `above` has the identities of the lists and tables that the value is in.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.ravel()[:MOST_ENTRIES].tolist() if value.size > MOST_ENTRIES else value.tolist()
    if value is None or isinstance(value, bool):
        return "none" if value is None else str(value).lower()
    if not isinstance(value, list | tuple | dict):
        return repr(value)
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    if id(value) in above or len(above) > DEEPEST:
        return f"{opening}...{closing}"
    inside = *above, id(value)
    if isinstance(value, dict):
        pairs = islice(value.items(), MOST_ENTRIES)
        texts = [f"{_written(name, inside)}: {_written(entry, inside)}" for name, entry in pairs]
    else:
        texts = [_written(entry, inside) for entry in value[:MOST_ENTRIES]]
    return f"{opening}{', '.join([*texts, '…'][: len(value)])}{closing}"


def is_plain(text: str) -> bool:
    """Whether a text has neither control characters nor bytes that are no text (lone surrogates)."""
    return not any(unicodedata.category(character) in ("Cc", "Cs") for character in text)


def distinct_texts(*numbers: float) -> list[str]:
    """Numbers in as few digits as tell those apart that differ, and in no fewer than six.

    Parameters
    ----------
    *numbers : float
        What one message names: what it received beside the bounds that it expected.
    """
    different = len(set(numbers))
    for digits in range(FEWEST_DIGITS, MOST_DIGITS):
        texts = [f"{number:.{digits}g}" for number in numbers]
        if len(set(texts)) >= different:
            return texts
    return [f"{number:.{MOST_DIGITS}g}" for number in numbers]


def did_you_mean(received: str, valid: Iterable[str]) -> str:
    """``"; did you mean NAME?"`` for the valid name nearest to what was received, or nothing."""
    # Beyond this length no name is meant, and the comparison would take seconds.
    near = difflib.get_close_matches(received, valid, n=1) if len(received) < LONGEST_WORD else []
    return f"; did you mean {near[0]}?" if near else ""


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
        law_error = cls(f"law {law}: expected a torque at {t_s:g} s, received {exception_text(error)}")
        law_error.__cause__ = error
        return law_error


class EngineError(SpheretwinError):
    """The physics engine reported a fault that no input explains."""
