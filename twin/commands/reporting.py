"""What the verbs share in telling their user: JSON, warnings, progress, files."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

from spheretwin.models.base.check import Check
from spheretwin.models.base.files import whole_file


def print_json(figures: Mapping[str, Any]) -> None:
    """Print figures as JSON on stdout; what is not finite becomes null."""
    print(json.dumps(_finite(figures), allow_nan=False), flush=True)


def warn(lines: Iterable[str]) -> None:
    """Print warnings on stderr, one line each."""
    for line in lines:
        print(f"spheretwin: warning: {line}", file=sys.stderr)


def tracked(label: str) -> Callable[[range], Iterable[int]]:
    """Progress bar on stderr for a range of steps; silent where stderr is no terminal."""
    console = Console(stderr=True)
    return lambda steps: track(steps, label, console=console, transient=True, disable=not console.is_terminal)


def write_text(path: Path, text: str) -> None:
    """Write a file, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def kept(what: str, checks: Sequence[Check]) -> bool:
    """Whether every check keeps its bound; those that do not are named on stderr."""
    broken = [check.name for check in checks if not check.ok]
    if broken:
        print(f"spheretwin: {what}: broken: {', '.join(broken)}", file=sys.stderr)
    return not broken


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
