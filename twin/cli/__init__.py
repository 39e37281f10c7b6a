"""Command line `spheretwin`: one file for each verb."""

from __future__ import annotations

import argparse
import errno
import io
import os
import sys
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from itertools import pairwise
from typing import NoReturn

from spheretwin.cli import bench, crosscheck, magnetics, reproduce, review, simulate, sweep
from spheretwin.cli import review as recover
from spheretwin.models.base.errors import (
    InputError,
    SpheretwinError,
    is_plain,
    one_line,
    shown,
    without_breaks,
)

DONE, FAILED, BAD_INPUT = 0, 1, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; return the exit code."""
    # Errors of Rerun are raised or found at the end of its files: its own log would only repeat them.
    os.environ.setdefault("RUST_LOG", "off")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal without Greek letters
    try:
        given = _plain(sys.argv[1:] if arguments is None else arguments)
        options, rest = _parser().parse_known_args(given)
        _check_flags(given, options)
        succeeded = options.run(options, rest)
        sys.stdout.flush()
    except InputError as error:
        return _refused(f"{error}", BAD_INPUT)
    except SpheretwinError as error:
        return _refused(f"{error}", FAILED)
    except KeyboardInterrupt:
        return _refused("interrupted", FAILED)
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        _discard_stdout()
        return FAILED
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:  # no file can have the name that was given
            return _refused(f"command line: expected a shorter path, {without_breaks(error)}", BAD_INPUT)
        _discard_stdout()
        return _refused(f"output: {without_breaks(error)}", FAILED)
    return DONE if succeeded else FAILED


def _refused(message: str, code: int) -> int:
    print(f"spheretwin: {one_line(message)}", file=sys.stderr)
    return code


def _plain(arguments: Sequence[str]) -> Sequence[str]:
    """Return the arguments if they are safe in terminals and in files of other programs."""
    for argument in arguments:
        if not is_plain(argument):
            raise InputError(
                f"command line: expected text without control characters, received {shown(argument)}"
            )
    return arguments


def _check_flags(arguments: Sequence[str], options: argparse.Namespace) -> None:
    """Refuse a flag that is given twice, unless it is a list, and an empty value of a verb's own flag."""
    if getattr(options, "help", False):
        return
    flags = [argument.partition("=")[0].replace("_", "-") for argument in arguments if argument[:2] == "--"]
    for flag, count in Counter(flags).items():
        name = flag[2:].replace("-", "_")
        if count > 1 and not isinstance(getattr(options, name, None), list):
            raise InputError(f"command line: expected {flag} once, received it {count} times")
        if hasattr(options, name) and _is_empty(arguments, flag):
            raise InputError(f"command line: expected a value after {flag}, received an empty text")


def _is_empty(arguments: Sequence[str], flag: str) -> bool:
    """True if a flag is followed by an empty text, as in ``--out ""`` or ``--out=``."""
    following = pairwise(arguments)
    return f"{flag}=" in arguments or (flag, "") in following


def _discard_stdout() -> None:
    """Prevent Python from flushing unwritable output at its exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Parser(argparse.ArgumentParser):
    """Parser with the messages of the package: one line, exit code 2."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"command line: {message}")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="spheretwin",
        description="Digital twin of a permanent-magnet spherical actuator.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"spheretwin {version('spheretwin')}")
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    simulate.add_to(verbs)
    bench.add_to(verbs)
    crosscheck.add_to(verbs)
    reproduce.add_to(verbs)
    sweep.add_to(verbs)
    review.add_review(verbs)
    recover.add_recover(verbs)
    magnetics.add_to(verbs)
    return parser
