"""Folder of a bench: its files, and those that commands read and write; no file is overwritten."""

from __future__ import annotations

import ast
import stat
import tomllib
from collections.abc import Callable, Iterable
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

from spheretwin.models.base.errors import InputError, shown, without_breaks
from spheretwin.models.base.files import check_writable
from spheretwin.models.base.user_code import is_reference
from spheretwin.scenario import reading
from spheretwin.scenario.sections import Scenario


class Folder:
    """Folder of one bench.

    Parameters
    ----------
    path : Path, optional
        Folder; default: the working folder, and files may be anywhere.
    scenario : Scenario
        Scenario at the start of the bench: its files may be anywhere.
    given : iterable of Path
        Further files that may be anywhere.

    Raises
    ------
    InputError
        It is not a folder.
    """

    def __init__(self, path: Path | None, scenario: Scenario, given: Iterable[Path] = ()) -> None:
        self.bounded = path is not None
        self.path = (path or Path.cwd()).resolve()
        if not self.path.is_dir():
            raise InputError(f"bench: expected a folder, received {path}")
        named = reading.named_files(scenario.model_dump(mode="json"))
        self._given = {self._resolved(name) for name in (*(name for name, _ in named), *map(str, given))}

    def readable(self, name: str) -> Path:
        """Return the complete path of a file to read; the file is not opened.

        Raises
        ------
        InputError
            It is not below the folder, or not a regular file, such as a pipe or a device.
        """
        path = self._resolved(name)
        self._check_below(path, name)
        try:
            is_regular = stat.S_ISREG(path.stat().st_mode)
        except (OSError, ValueError) as error:
            raise InputError(f"bench: expected a readable file, {without_breaks(error)}") from None
        if not is_regular:
            raise InputError(f"bench: expected a regular file, received {path}")
        return path

    def value(self, name: str, value: Any) -> Any:
        """Return the value of a field with complete paths.

        Raises
        ------
        InputError
            It names a file that is not readable.
        """
        return reading.replace_value_files(name, value, lambda path, _: self._reference(path))

    def source(self, source: str, overrides: dict[str, Any]) -> tuple[str, dict[str, Any]]:
        """Return a scenario to load, and values for its fields, with complete paths.

        Raises
        ------
        InputError
            The scenario or one of its files is not readable.
        """
        if source not in reading.shipped() and source.endswith(".toml"):
            source = str(self.readable(source))
            for named, _ in reading.named_files(reading.read(source)):
                self.readable(named)
        return source, {name: self.value(name, value) for name, value in overrides.items()}

    def claim(self, *names: str) -> list[Path]:
        """Create empty files to be written, and return their complete paths.

        If one of the names exists, all of them get the first number that is free: ``run-2.rrd``.

        Raises
        ------
        InputError
            A file is not below the folder, or cannot be created.
        """
        targets = [self._resolved(name) for name in names]
        for target, name in zip(targets, names, strict=True):
            self._check_below(target, name)
            check_writable(target)
        if len(set(targets)) < len(targets):
            raise InputError(f"output: expected a separate path for each file, received {names[0]} twice")
        for number in count(1):
            numbered = [target if number == 1 else _numbered(target, number) for target in targets]
            if _create(numbered):
                return numbered
        raise AssertionError  # `count` does not end

    def _reference(self, text: str) -> str:
        if not is_reference(text):
            return str(self.readable(text))
        file, _, name = text.rpartition(":")
        return f"{self.readable(file)}:{name}"

    def _resolved(self, name: str) -> Path:
        try:
            return (self.path / Path(name).expanduser()).resolve()
        except (OSError, RuntimeError, ValueError):  # links in a circle, no home, a null character
            raise InputError(f"bench: expected a path, received {shown(name)}") from None

    def _check_below(self, path: Path, name: str) -> None:
        if self.bounded and path not in self._given and not path.is_relative_to(self.path):
            raise InputError(f"bench: expected a file below {self.path}, received {shown(name)}")


def release(paths: Iterable[Path]) -> None:
    """Remove claimed files that are still empty."""
    for path in paths:
        with suppress(OSError):
            if not path.stat().st_size:
                path.unlink()


def _numbered(path: Path, number: int) -> Path:
    return path.with_name(f"{path.stem}-{number}{path.suffix}")


def _create(paths: list[Path]) -> bool:
    """Create all files, or none if one of them exists."""
    created: list[Path] = []
    for path in paths:
        try:
            path.open("xb").close()
        except FileExistsError:
            release(created)
            return False
        except OSError as error:
            release(created)
            raise InputError(f"output: expected a writable path, {without_breaks(error)}") from None
        created.append(path)
    return True


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
