"""What the verbs share in telling their user: JSON, warnings, broken bounds, files."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from spheretwin.models import mjcf
from spheretwin.models.base.check import Check, broken
from spheretwin.models.base.files import whole_file


def print_json(figures: Mapping[str, Any]) -> None:
    """Print figures as JSON on stdout: checks as their rows, named tuples by name, null for no number."""
    print(json.dumps(_plain(figures), allow_nan=False), flush=True)


def warn(lines: Iterable[str]) -> None:
    """Print warnings on stderr, one line each."""
    for line in lines:
        print(f"spheretwin: warning: {line}", file=sys.stderr)


def warn_of_model(path: Path) -> None:
    """Print what the engine warns of in a model file."""
    warn(mjcf.read(path).warnings)


def add_verbose(parser: argparse.ArgumentParser) -> None:
    """Add the flag of the verbs that have checks."""
    parser.add_argument(
        "--verbose", action="store_true", help="also say what each check compares, and why its bound"
    )


def write_text(path: Path, text: str) -> None:
    """Write a file, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def kept(what: str, checks: Iterable[Check]) -> bool:
    """Whether every check keeps its bound; those that do not are named on stderr."""
    names = broken(checks)
    if names:
        print(f"spheretwin: {what}: broken: {'; '.join(names)}", file=sys.stderr)
    return not names


def _plain(value: Any) -> Any:
    """What JSON can hold of a value; what is not finite becomes null."""
    if isinstance(value, Check):
        return value.row()
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
