"""Files of a folder that a bench can use: scenarios, laws and recorded runs."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Callable
from pathlib import Path

MOST_FILES = 200

# Sections that a scenario has and other TOML files have not.
SECTIONS = ("trajectory", "controller", "plant")


class FolderFiles:
    """Files of a folder, by their paths relative to it; no code of them is executed.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[Path, tuple[float, list[str]]] = {}

    def scenarios(self) -> list[str]:
        """Return the scenarios."""
        return self._names("*.toml", _scenarios)

    def laws(self) -> list[str]:
        """Return the laws in the Python files as ``FILE.py:NAME``."""
        return self._names("*.py", _laws)

    def runs(self) -> list[str]:
        """Return telemetry and recordings, the newest first."""
        files = [*self._path.glob("*.parquet"), *self._path.glob("*.rrd")]
        dated = [(path.stat().st_mtime, path.name) for path in files if path.is_file()]
        return [path for _, path in sorted(dated, reverse=True)[:MOST_FILES]]

    def _names(self, pattern: str, read: Callable[[Path], list[str]]) -> list[str]:
        """Return what the files of a pattern hold; a file is read again after a change."""
        names = []
        for path in sorted(self._path.glob(pattern))[:MOST_FILES]:
            if not path.is_file():  # a pipe would never end
                continue
            changed_s = path.stat().st_mtime
            if self._known.get(path, (None,))[0] != changed_s:
                try:
                    self._known[path] = changed_s, read(path)
                except (OSError, ValueError, SyntaxError, RecursionError):
                    self._known[path] = changed_s, []
            names += self._known[path][1]
        return names


def _scenarios(path: Path) -> list[str]:
    fields = tomllib.loads(path.read_text(encoding="utf-8"))
    return [path.name] if any(isinstance(fields.get(name), dict) for name in SECTIONS) else []


def _laws(path: Path) -> list[str]:
    """Return the subclasses of `LawParameters`, or else the functions with the arguments of a step."""
    nodes = ast.parse(path.read_text(encoding="utf-8")).body
    laws = [
        node.name
        for node in nodes
        if isinstance(node, ast.ClassDef)
        and any(ast.unparse(base).endswith("LawParameters") for base in node.bases)
    ] or [
        node.name
        for node in nodes
        if isinstance(node, ast.FunctionDef)
        and {"reference", "torque"} <= {each.arg for each in node.args.args}
    ]
    return [f"{path.name}:{name}" for name in laws]
