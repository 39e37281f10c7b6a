"""Errors of this package, with a common base class, and the wording of values in messages."""

from __future__ import annotations

import difflib
import os
import unicodedata
from collections.abc import Iterable
from itertools import islice

import numpy as np

# A path or a name of usual length stays complete; thousands of digits do not.
LONGEST_VALUE, LONGEST_WORD, LONGEST_LINE = 120, 300, 2000

# Entries and levels of a list or a table beyond which its text is always cut.
MOST_ENTRIES, DEEPEST = 60, 10

HIDDEN = ".part"
"""End of the name of a temporary file."""

FEWEST_DIGITS, MOST_DIGITS = 6, 17  # 17 significant digits distinguish any two floats


def one_line(text: str) -> str:
    """Return a message for a terminal: one line of limited length without control characters.

    Line breaks, escape sequences and other characters that cannot be printed appear as in Python's `ascii`. A
    text that is too long is cut in the middle.
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
            # Other libraries put paths and numbers into the text of the error.
            text = os.strerror(error.errno) if error.errno else error.strerror
            named = error.filename if error.filename2 is None else error.filename2
            is_hidden = f"{named}".endswith(HIDDEN)  # a temporary file, whose target the message names
            return text if named is None or is_hidden else f"{text}: {named}"
    return " ".join(str(error).split())


def exception_text(error: BaseException) -> str:
    """Return type and message of an exception, as ``ValueError: lost``; the type alone without a message."""
    message = without_breaks(error)
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def shortened(text: str, longest: int) -> str:
    """Return a text cut in the middle to at most `longest` characters."""
    if len(text) <= longest:
        return text
    head = (longest - 1) // 2
    return f"{text[:head]}…{text[head + 1 - longest :]}"


def shown(value: object) -> str:
    """Return a received value as in JSON or TOML, on one line of limited length.

    Other types are written as in Python.
    """
    try:
        text = _written(value)
    except ValueError:  # an integer with more digits than Python writes
        return "a number of too many digits"
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # an object of the user, which may raise anything
        return (
            f"a value of class {type(value).__name__}, which raises {type(error).__name__} when it is written"
        )
    return shortened(" ".join(line.strip() for line in text.splitlines()), LONGEST_VALUE)


def _written(value: object, above: tuple[int, ...] = ()) -> str:
    """Return the text of a value; entries that are nested too deeply, or too many, are left out.

    `above` holds the identities of the lists and tables that contain the value.
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
    """Return True if a text has neither control characters nor undecodable bytes (lone surrogates)."""
    return not any(unicodedata.category(character) in ("Cc", "Cs") for character in text)


def distinct_texts(*numbers: float) -> list[str]:
    """Return texts of numbers with the fewest digits, at least six, that distinguish different numbers.

    Parameters
    ----------
    *numbers : float
        Numbers of one message: the received one and the expected bounds.
    """
    different = len(set(numbers))
    for digits in range(FEWEST_DIGITS, MOST_DIGITS):
        texts = [f"{number:.{digits}g}" for number in numbers]
        if len(set(texts)) >= different:
            return texts
    return [f"{number:.{MOST_DIGITS}g}" for number in numbers]


def did_you_mean(received: str, valid: Iterable[str]) -> str:
    """Return ``"; did you mean NAME?"`` for the valid name nearest to the received one, or an empty text."""
    near = nearest(received, valid)
    return f"; did you mean {near}?" if near else ""


def unknown_name(what: str, name: object, valid: Iterable[str], expected: str = "{}") -> InputError:
    """Return the error for a name that is not valid.

    Parameters
    ----------
    what : str
        Beginning of the message.
    name : object
        Received name.
    valid : iterable of str
        Valid names.
    expected : str
        Expected value; braces stand for the valid names.
    """
    names = list(valid)
    listed = expected.format(", ".join(names))
    return InputError(f"{what}: expected {listed}, received {shown(name)}{did_you_mean(f'{name}', names)}")


def nearest(received: str, valid: Iterable[str]) -> str | None:
    """Return the valid name nearest to the received one; None if none is similar."""
    # A longer text is not a name, and the comparison would take seconds.
    near = difflib.get_close_matches(received, valid, n=1) if len(received) < LONGEST_WORD else []
    return near[0] if near else None


class SpheretwinError(Exception):
    """Base class of all errors of this package; the message is one line that any terminal can show.

    Parameters
    ----------
    message : str
        Expected value, received value, valid names; control characters are escaped, and long values are
        shortened.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class InputError(SpheretwinError):
    """Invalid input of the user: a scenario, a flag, a file or a law."""


class LawError(SpheretwinError):
    """Exception of a control law instead of a torque."""

    @classmethod
    def of(cls, law: str, t_s: float, error: BaseException) -> LawError:
        """Return the error of a law by its name, at a time, s; the exception becomes the cause."""
        law_error = cls(f"law {law}: expected a torque at {t_s:g} s, received {exception_text(error)}")
        law_error.__cause__ = error
        return law_error


class EngineError(SpheretwinError):
    """The physics engine reported a fault that no input explains."""
