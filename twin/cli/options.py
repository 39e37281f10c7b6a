"""Parser of the verbs: common options, numbers within bounds, messages of one line."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from spheretwin.models.base.errors import InputError, did_you_mean, shown

COMMON: dict[str, dict[str, Any]] = {
    "--figure-format": {
        "choices": ("svg", "pdf", "png", "pdf-one-column", "pdf-two-columns"),
        "default": "svg",
        "help": "format in which figures are written in addition to svg; pdf also with the width of one"
        " column (3.5 in) or of two columns (7.16 in) of a paper",
    },
    "--json": {"action": "store_true"},
    "--mjcf": {"type": Path, "metavar": "FILE.xml", "help": "model file"},
    "--out": {"type": Path, "metavar": "DIR"},
    "--record": {"type": Path, "metavar": "FILE.rrd"},
    "--verbose": {
        "action": "store_true",
        "help": "also print what each check compares, and the reason of its bound",
    },
    "scenario": {"metavar": "SCENARIO", "nargs": "?"},
}
"""Settings of the options that several verbs have; a verb adds its own settings."""

MOST = 10**12


class _Formatter(argparse.HelpFormatter):
    """Help with short lines for long options."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=27)


class Parser(argparse.ArgumentParser):
    """Parser of the command or of one verb.

    Attributes
    ----------
    expected : list of str
        Names of the arguments, for the message about an unknown argument.
    """

    def __init__(self, **settings: Any) -> None:
        self.expected: list[str] = []
        super().__init__(**settings, allow_abbrev=False, formatter_class=_Formatter)

    def add_argument(self, *names: str, **settings: Any) -> argparse.Action:
        """Add an argument; the settings of a common option apply unless others are given."""
        settings = {**COMMON.get(names[0], {}), **settings}
        if "--help" not in names:
            self.expected.append(names[0] if names[0].startswith("-") else settings["metavar"])
        return super().add_argument(*names, **settings)

    def set_run(self, run: Callable[[argparse.Namespace], bool], *, has_fields: bool = False) -> None:
        """Set the function of a verb; with `has_fields` any field of a scenario is a flag."""
        self.set_defaults(run=run, parser=self, has_fields=has_fields)
        if has_fields:
            self.add_argument(
                "-h",
                "--help",
                nargs="?",
                const="",
                metavar="SECTION",
                help="show this help, or the fields of a section, or all",
            )

    def error(self, message: str) -> NoReturn:
        """Refuse the command line with exit code 2."""
        raise InputError(f"command line: {message}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a value that is not a valid choice, with the nearest valid one."""
        if action.choices is not None and value not in action.choices:
            valid = list(map(str, action.choices))
            name = action.metavar or "/".join(action.option_strings)
            raise InputError(
                f"command line: expected {name} {', '.join(valid)},"
                f" received {shown(value)}{did_you_mean(f'{value}', valid)}"
            )


def whole(last: int = MOST, *, first: int = 1, name: str = "a whole number") -> Callable[[str], int]:
    """Return a function that reads a whole number between two bounds."""

    def read(text: str) -> int:
        is_number = text.isascii() and text.isdecimal() and len(text) <= len(str(last))
        if not is_number or not first <= int(text) <= last:
            raise argparse.ArgumentTypeError(f"expected {name} from {first} to {last}, received {text}")
        return int(text)

    return read


def number(name: str, is_valid: Callable[[float], bool]) -> Callable[[str], float]:
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
