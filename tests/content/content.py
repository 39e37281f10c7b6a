"""Approved content: the text of a case, the file that holds the approved one, and what varies by machine."""

import atexit
import contextlib
import functools
import io
import os
import re
import shutil
import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager
from importlib import import_module
from pathlib import Path
from unittest.mock import patch

import pytest

from spheretwin import cli
from spheretwin.models.base.errors import SpheretwinError
from tests.content.compare import difference

FOLDER = Path(__file__).parent
EXPECTED = FOLDER / "expected"

Cases = dict[str, Callable[[], str]]

PACKAGES = (
    "spheretwin|mujoco|numba|llvmlite|numpy|rerun|rerun-sdk|scipy|pyarrow|pydantic|matplotlib|pinocchio|magpylib"
    "|optuna"
)

VOLATILE = (
    (rf"(\b(?:python|{PACKAGES})[ =]+v?'?)\d+\.\d[\w.+-]*", r"\1VERSION"),
    (r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?( ?UTC|Z|\+00:00)?", "TIME"),
    (r"\b[0-9a-f]{40,64}\b", "DIGEST"), (r"crosscheck, \d+\.\d s", "crosscheck, DURATION"),
    (r"(\"?(?:wall_s|realtime_factor)\"?:? )(?:[\d.e+-]+|null|None)", r"\1DURATION"),
    (r"simulated in \d+\.\d+ s: \S+ times", "simulated in DURATION"), (r"(open it: +)\S*rerun\b", r"\1rerun"),
    (r"(\"versions\": )\{[^}]*\}", r"\1VERSIONS"), (r"(which the extra \w+ installs: ).*", r"\1COMMAND"),
    (r"\b[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}\b", "UUID"),
)  # fmt: skip
"""Texts that vary by machine, version or time, and their placeholders. A case adds its own by `replaced`."""


def stable(text: str) -> str:
    """Return a text with placeholders for what varies; trailing spaces are omitted."""
    for folder in sorted({str(scratch()), str(scratch().resolve())}, key=len, reverse=True):
        text = text.replace(folder, "FOLDER")
    text = text.replace(str(FOLDER.parents[1]), "SOURCES")
    for pattern, placeholder in VOLATILE:
        text = re.sub(pattern, placeholder, text)
    return "".join(f"{line.rstrip()}\n" for line in text.splitlines())


@functools.cache
def _scratch() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="content"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def scratch(name: str = "") -> Path:
    """Return a folder of this process, or a new folder in it; it is removed at the exit."""
    folder = _scratch() / name
    folder.mkdir(exist_ok=True)
    return folder


def expected_path(name: str) -> Path:
    """Return the file with the approved text of a case."""
    return EXPECTED / f"{name}.txt"


def check(name: str, cases: Cases) -> None:
    """Compare the text of a case with the approved one."""
    result = difference(expected_path(name).read_text(encoding="utf-8"), stable(cases[name]()))
    assert not result, (
        f"{name}: the content changed. If it is right: python -m tests.content.approve {name}\n{result}"
    )


def content_test(cases: Cases, release: dict[str, str] | None = None) -> Callable[[str], None]:
    """Return the test of some cases; those with a reason run in the release suite only."""
    reasons = release or {}
    names = [
        pytest.param(name, marks=pytest.mark.release(reasons[name])) if name in reasons else name
        for name in cases
    ]

    @pytest.mark.parametrize("name", names)
    def test_content(name: str) -> None:
        check(name, cases)

    return test_content


def all_cases() -> dict[str, Cases]:
    """Return the cases of each test file of this folder."""
    return {
        path.stem: import_module(f"tests.content.{path.stem}").CASES
        for path in sorted(FOLDER.glob("test_*.py"))
        if "CASES" in path.read_text(encoding="utf-8")
    }


def _columns(count: int) -> AbstractContextManager[object]:
    return patch.dict(os.environ, COLUMNS=str(count))


def refusal(call: Callable[..., object], *arguments: object, **named: object) -> str:
    """Return the message of a refusal; of accepted input, that it was accepted."""
    try:
        call(*arguments, **named)
    except SpheretwinError as error:
        return str(error)
    return "accepted"


def printed(call: Callable[[], object], columns: int = 80) -> str:
    """Return what a call prints on stdout at a width of the terminal."""
    with _columns(columns), contextlib.redirect_stdout(io.StringIO()) as out:
        call()
    return out.getvalue()


def command(*arguments: object, columns: int = 80) -> str:
    """Return the command line of a call, its exit code, and what it prints on both streams."""
    given = [str(argument) for argument in arguments]
    with (
        _columns(columns),
        contextlib.redirect_stdout(io.StringIO()) as out,
        contextlib.redirect_stderr(io.StringIO()) as err,
    ):
        try:
            code = cli.main(given)
        except SystemExit as end:  # of argparse: help, version
            code = end.code
    streams = [
        f"{name}:\n{text.getvalue()}" for name, text in (("stdout", out), ("stderr", err)) if text.getvalue()
    ]
    return "\n".join([f"$ spheretwin {' '.join(given)}", f"exit code {code}", *streams])
