"""Parser of the verbs: options as their help lists them, numbers within bounds, messages of one line."""

from __future__ import annotations

import argparse
import inspect
import math
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from textwrap import dedent
from typing import Any, NamedTuple, NoReturn

from spheretwin.models.base.errors import InputError, unknown_name

FIGURE_FORMATS = ("svg", "pdf", "png", "pdf-one-column", "pdf-two-columns")

COMMON = """
--figure-format=svg  format in which figures are written in addition to svg; pdf also with the width of one
    column (3.5 in) or of two columns (7.16 in) of a paper
--json               print the figures as JSON, alone on stdout
--mjcf FILE.xml      model file
--out DIR            write a page with figures into this folder
--record FILE.rrd    write a Rerun recording
--telemetry FILE.parquet  write the telemetry
--twin TWIN.toml     use the fields of an identified twin
--verbose            also print what each check compares, and the reason of its bound
"""
"""Options that several verbs have; a verb that lists one by its name alone takes the rest from here."""

MOST = 10**12

_FILE = re.compile(r"FILE|DIR|[A-Z]+\.[a-z0-9]+")
"""Placeholders of paths."""


def whole(last: int = MOST, *, first: int = 1, name: str = "a whole number") -> Callable[[str], int]:
    """Return a function that reads a whole number between two bounds."""

    def read(text: str) -> int:
        is_number = text.isascii() and text.isdecimal() and len(text) <= len(str(last))
        if not is_number or not first <= int(text) <= last:
            raise argparse.ArgumentTypeError(f"expected {name} from {first} to {last}, received {text}")
        return int(text)

    return read


def positive(value: float) -> bool:
    """Return True for a number above 0."""
    return value > 0


def from_zero(value: float) -> bool:
    """Return True for a number from 0 on."""
    return value >= 0


def number(name: str, is_valid: Callable[[float], bool] = positive) -> Callable[[str], float]:
    """Return a function that reads a finite number for which a condition is true."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and is_valid(value)):
            raise argparse.ArgumentTypeError(f"expected {name}, received {text}")
        return value

    return read


READERS: dict[str, Any] = {
    "A": number("a number of A above 0"),
    "HZ": number("a number of Hz above 0"),
    "MS": number("a number of ms above 0"),
    "N": whole(),
    "PORT": whole(65535, first=0, name="a port"),
    "ROWS": whole(),
    "S": number("a number of s above 0"),
}
"""Functions that read the values of placeholders, unless a verb states another one."""


_NONE: Mapping[str, str] = {}


class Verb(NamedTuple):
    """Verb, or a part of one, with its options."""

    run: Callable[[argparse.Namespace], bool]
    """Returns True if it succeeded. Its docstring is the description in the help."""
    options: str
    has_fields: bool
    """Whether any field of a scenario is a flag."""
    usage: str
    unlisted: str
    needs: dict[str, str]
    excludes: dict[str, str]
    readers: dict[str, Any]


def verb(
    options: str,
    *,
    has_fields: bool = False,
    usage: str = "",
    unlisted: str = "",
    needs: Mapping[str, str] = _NONE,
    excludes: Mapping[str, str] = _NONE,
    **readers: Any,
) -> Callable[[Callable[[argparse.Namespace], bool]], Verb]:
    """Return a decorator that makes a function a verb.

    Each argument begins a line of the text, as the help prints it, as ``--rate HZ=10  rows per second``: its
    placeholder, its default, and after two spaces its help, which indented lines continue. An option without
    a placeholder is a switch; brackets make an argument optional, and dots after the placeholder make it
    repeatable.

    Parameters
    ----------
    options : str
        Arguments.
    has_fields : bool
        Whether any field of a scenario is a flag.
    usage : str
        Required arguments; default: the first one, unless argparse checks that.
    unlisted : str
        Further arguments, which the help does not list.
    needs, excludes : mapping, optional
        By option: others of which it needs one, or that it excludes, as ``{"--draws": "--twin"}``.
    **readers : callable, sequence or dict
        By name: the function that reads a value, its valid values, or settings for argparse. By default,
        placeholders of files and folders are paths, and those without a reader texts.
    """
    return lambda run: Verb(run, options, has_fields, usage, unlisted, {**needs}, {**excludes}, readers)


class _Formatter(argparse.HelpFormatter):
    """Help with short lines for long options; a description with indented lines keeps its lines."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=27)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if "\n  " in text else super()._fill_text(text, width, indent)


class Parser(argparse.ArgumentParser):
    """Parser of the command or of one verb.

    Attributes
    ----------
    expected : list of str
        Names of the arguments, for the message about an unknown argument.
    """

    def __init__(self, **settings: Any) -> None:
        self.expected: list[str] = []
        self._required = ""
        # Verbs that run a scenario replace the option --help by their own.
        options: dict[str, Any] = {
            "allow_abbrev": False,
            "formatter_class": _Formatter,
            "conflict_handler": "resolve",
        }
        super().__init__(**settings, **options)

    def define(self, verb: Verb | dict[str, Verb]) -> None:
        """Define a verb, or its parts by their names."""
        if isinstance(verb, dict):
            parts = self.add_subparsers(metavar="PART", required=True)
            for name, part in verb.items():
                summary = _description(part).partition("\n")[0].rstrip(".")
                summary = summary[:1].lower() + summary[1:]
                parts.add_parser(name, help=summary).define(part)
            return
        self.description = _description(verb)
        self._add_options(verb.options, verb.readers)
        self._add_options(verb.unlisted, verb.readers, listed=False)
        if "--mjcf" in self.expected:
            from spheretwin.models.actuator import MJCF_PATH  # MuJoCo is slow to import

            self.set_defaults(mjcf=MJCF_PATH)
        self.set_defaults(run=verb.run, parser=self, has_fields=verb.has_fields)
        self._verb = verb
        if verb.has_fields:
            self._required = verb.usage or self.expected[0]
            self.usage = f"{self.prog} {self._required} [options] [--section.field VALUE ...]"
            text = "show this help, or the fields of a section, or all"
            self.add_argument("-h", "--help", nargs="?", const="", metavar="SECTION", help=text)

    def _add_options(self, text: str, readers: dict[str, Any], *, listed: bool = True) -> None:
        readers = {"figure_format": FIGURE_FORMATS} | readers
        common = {re.split("[ =]", spec)[0]: (spec, meaning) for spec, meaning in _entries(COMMON)}
        for spec, meaning in _entries(text):
            spec, standard = common.get(spec, (spec, ""))
            self._add_option(spec, meaning or standard if listed else argparse.SUPPRESS, readers)

    def _add_option(self, spec: str, meaning: str, readers: dict[str, Any]) -> None:
        left, _, default = spec.partition("=")
        names, _, placeholder = left.rpartition(" ") if " " in left or left[0] != "-" else (left, "", "")
        many, optional = "..." in placeholder, placeholder.startswith("[")
        placeholder = placeholder.strip("[]").removesuffix("...")
        name = names or placeholder.lower() + "s" * many
        is_file = _FILE.fullmatch(placeholder)
        reader = readers.get(
            name.strip("-").replace("-", "_"), READERS.get(placeholder, Path if is_file else ...)
        )
        settings: dict[str, Any] = {"help": meaning}
        if placeholder:
            settings["metavar"] = placeholder
        if default:
            settings["default"] = default
        if callable(reader):
            settings["type"] = reader
        elif isinstance(reader, dict):
            settings |= reader
        elif reader is not ...:
            settings |= {"choices": tuple(reader), "type": type(next(iter(reader)))}
        elif not placeholder:
            settings["action"] = "store_true"
        if many and names:
            settings |= {"action": "append", "default": []}
        elif many or optional:
            settings.setdefault("nargs", ("*" if optional else "+") if many else "?")
        self.expected.append(names or placeholder)
        self.add_argument(name, **settings)

    def check(self, options: argparse.Namespace) -> None:
        """Check that required arguments are given, and that options fit each other.

        Raises
        ------
        InputError
            They are not, or do not.
        """
        actions = {next(iter(action.option_strings), f"{action.metavar}"): action for action in self._actions}
        given = {
            name
            for name, action in actions.items()
            if getattr(options, action.dest, None) not in (None, False, [])
        }
        for name, action in actions.items():
            if name in self._required.split() and name not in given:
                placeholder = f" {action.metavar}" if action.option_strings else ""
                raise InputError(f"command line: expected {name}{placeholder} ({action.help}), received none")
        for name, others in self._verb.needs.items():
            if name in given and given.isdisjoint(others.split()):
                needed = " or ".join(others.split())
                raise InputError(f"command line: expected {name} with {needed}, received it alone")
        for name, others in self._verb.excludes.items():
            if name in given and (both := sorted(given.intersection(others.split()))):
                raise InputError(f"command line: expected {name} without {' and '.join(both)}, received both")

    def parts(self) -> dict[str, Parser]:
        """Return the parsers of the parts of a verb by their names; empty if it has none."""
        return next((one.choices for one in self._actions if isinstance(one, argparse._SubParsersAction)), {})

    def error(self, message: str) -> NoReturn:
        """Refuse the command line with exit code 2."""
        raise InputError(f"command line: {message}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a value that is not a valid choice, with the nearest valid one."""
        if action.choices is not None and value not in action.choices:
            name = action.metavar or "/".join(action.option_strings)
            raise unknown_name("command line", value, map(str, action.choices), f"{name} {{}}")


def _description(verb: Verb) -> str:
    return inspect.cleandoc(verb.run.__doc__ or "")


def _entries(text: str) -> Iterator[tuple[str, str]]:
    """Yield each option of a text, and its help."""
    for entry in filter(None, re.split(r"\n+(?=\S)", dedent(text).strip())):
        spec, _, meaning = entry.partition("  ")
        yield spec.strip(), " ".join(meaning.split())
