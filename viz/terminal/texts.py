"""Wrapped texts on stdout: fields of a scenario, and verdicts of experiments on the results of the paper."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

from spheretwin.viz.terminal import tables

INDENT, MEANING_COLUMN = 2, 34
"""Characters before a flag, and before its meaning."""


class FieldText(NamedTuple):
    """Field of a scenario as text."""

    flag: str
    value: str
    meaning: str


def print_fields(title: str, fields: Sequence[FieldText]) -> None:
    """Print flag, value and meaning of fields; the meaning stands on lines of its own if a line is short."""
    width = tables.terminal_console().width
    print(f"\n{title}:")
    for flag, value, meaning in fields:
        first = f"{' ' * INDENT}{flag} {value}".rstrip()
        lines = _wrapped(meaning, width, MEANING_COLUMN)
        if lines and len(first) < MEANING_COLUMN - 1:
            first, lines = first.ljust(MEANING_COLUMN) + lines[0].lstrip(), lines[1:]
        print("\n".join([first, *lines]))


def print_facts(title: str, facts: Sequence[tuple[str, str, str, str, str, str]]) -> None:
    """Print fields: name, value and unit in one line; meaning, distribution and origin below it."""
    width = tables.terminal_console().width
    print(f"{title}:")
    for name, value, unit, distribution, origin, meaning in facts:
        print(" ".join(filter(None, [f"\n{name} = {value or 'none'}", unit])))
        for label, text in (("", meaning), ("distribution: ", distribution), ("origin: ", origin)):
            if text:
                print("\n".join(_wrapped(label + text, width, 2 * INDENT)))


def print_findings(title: str, findings: Sequence[tuple[str, str, str, str]], lines: Sequence[str]) -> None:
    """Print a verdict, then name, severity, place and advice of each finding, then more lines."""
    width = tables.terminal_console().width
    print(title)
    for name, severity, where, advice in findings:
        print("\n".join(_wrapped(f"{severity} {name}: {where}", width, INDENT, "- ")))
        print("\n".join(_wrapped(f"{advice}.", width, 2 * INDENT)))
    for line in lines:
        print("\n".join(_wrapped(line, width, INDENT)))


def print_sections(sections: Sequence[str]) -> None:
    """Print the names of the sections, and how their fields are printed."""
    width = tables.terminal_console().width
    text = f"sections (--help SECTION): {', '.join(sections)}"
    print("\n" + "\n".join(_wrapped(text, width, 0)))


MOST_LINES = 36
"""Lines of all verdicts; paths of written files follow."""


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
        lines = [
            line
            for reproduced, text in sorted(verdict.results, key=_rank)
            # A mark of omission may follow.
            for line in _wrapped(f"{MARKS[reproduced]}{text}.", width - 2, INDENT, "- ")
        ]
        if len(lines) > space:
            lines = lines[:space]
            lines[-1:] = [f"{line} …" for line in lines[-1:]]
        print("".join(f"{line}\n" for line in lines), end="")
    print("--verbose prints all results and tables; --out DIR writes them with figures.")


def _rank(result: tuple[bool | None, str]) -> int:
    return [False, True, None].index(result[0])


MARKS = {True: "reproduced: ", False: "not reproduced: ", None: ""}


def _wrapped(text: str, width: int, indent: int, mark: str = "") -> list[str]:
    blank = " " * indent
    return textwrap.wrap(
        text,
        width,
        initial_indent=f"{blank}{mark}",
        subsequent_indent=f"{blank}{' ' * len(mark)}",
        break_long_words=False,
        break_on_hyphens=False,
    )
