"""Verdicts of experiments on the results of the paper, on stdout: at most one screen."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

from spheretwin.viz.terminal import tables

MOST_LINES = 36
"""Lines of all verdicts; paths of written files follow."""

INDENT = "  "


class Verdict(NamedTuple):
    """Results of one experiment."""

    name: str
    title: str
    results: Sequence[tuple[bool | None, str]]
    """Whether each result of the paper is reproduced, None for one that is not in the paper; its text."""

    def text(self) -> str:
        """Return the verdict in words."""
        compared = [reproduced for reproduced, _ in self.results if reproduced is not None]
        if not self.results:
            return "no verdict: not all of its cases were run"
        if not compared:
            return "not in the paper"
        count = f"{sum(compared)} of {len(compared)} results reproduced"
        return count if len(compared) > 1 else "reproduced" if compared[0] else "not reproduced"


def print_verdicts(verdicts: Sequence[Verdict]) -> None:
    """Print a verdict for each experiment, and its results as far as one screen has space.

    Results that were not reproduced come first.
    """
    width = tables.terminal_console().width
    space = max(0, (MOST_LINES - 1) // max(1, len(verdicts)) - 1)
    for verdict in verdicts:
        print(textwrap.shorten(f"{verdict.name}: {verdict.text()}. {verdict.title}", width, placeholder=" …"))
        lines = [line for result in sorted(verdict.results, key=_rank) for line in _wrapped(*result, width)]
        if len(lines) > space:
            lines = lines[:space]
            lines[-1:] = [f"{line} …" for line in lines[-1:]]
        print("".join(f"{line}\n" for line in lines), end="")
    print("--verbose prints all results and tables; --out DIR writes them with figures.")


def _rank(result: tuple[bool | None, str]) -> int:
    return [False, True, None].index(result[0])


MARKS = {True: "reproduced: ", False: "not reproduced: ", None: ""}


def _wrapped(reproduced: bool | None, text: str, width: int) -> list[str]:
    return textwrap.wrap(
        f"{MARKS[reproduced]}{text}.",
        width - 2,  # a mark of omission may follow
        initial_indent=f"{INDENT}- ",
        subsequent_indent=2 * INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )
