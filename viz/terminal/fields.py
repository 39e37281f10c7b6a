"""Fields of a scenario as text, on stdout."""

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


def print_sections(sections: Sequence[str]) -> None:
    """Print the names of the sections, and how their fields are printed."""
    width = tables.terminal_console().width
    text = (
        f"sections: {', '.join(sections)}. --help SECTION prints the fields of one, --help all every field."
    )
    print("\n" + "\n".join(_wrapped(text, width, 0)))


def _wrapped(text: str, width: int, indent: int) -> list[str]:
    blank = " " * indent
    return textwrap.wrap(
        text,
        width,
        initial_indent=blank,
        subsequent_indent=blank,
        break_long_words=False,
        break_on_hyphens=False,
    )
