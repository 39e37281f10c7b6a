"""The `spheretwin` command.

Exit 0: done. 1: a run or a check failed. 2: bad input, told in one line.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from spheretwin.models.errors import InputError, SpheretwinError
from spheretwin.twin.commands import magnetics, simulate

DONE, FAILED, BAD_INPUT = 0, 1, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit code."""
    try:
        options, rest = _parser().parse_known_args(arguments)
        succeeded = options.run(options, rest)
    except InputError as error:
        print(f"spheretwin: {error}", file=sys.stderr)
        return BAD_INPUT
    except SpheretwinError as error:
        print(f"spheretwin: {error}", file=sys.stderr)
        return FAILED
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    return DONE if succeeded else FAILED


class _Parser(argparse.ArgumentParser):
    """A parser whose complaints are the package's own: one line, exit code 2."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"command line: {message}")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="spheretwin",
        description="Digital twin of a permanent-magnet spherical actuator.",
        allow_abbrev=False,
    )
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    simulate.add_to(verbs)
    magnetics.add_to(verbs)
    return parser


if __name__ == "__main__":
    sys.exit(main())
