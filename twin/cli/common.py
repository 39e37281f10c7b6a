"""Common functions of the verbs: JSON, warnings, broken bounds, files, signals."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import shlex
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from spheretwin.models import mjcf
from spheretwin.models.base.checks import Check, broken
from spheretwin.models.base.files import OPEN_FILES, PartialFile
from spheretwin.viz.pages.markdown import ResultTable
from spheretwin.viz.terminal import runs
from spheretwin.viz.terminal.tables import print_checks, terminal_console


def print_json(figures: Mapping[str, Any]) -> None:
    """Print figures as JSON on stdout: checks as their rows, named tuples by name, null for no number."""
    print(json.dumps(_plain(figures), allow_nan=False), flush=True)


def print_result(
    options: argparse.Namespace,
    name: str,
    figures: Mapping[str, Any],
    tables: Iterable[ResultTable] = (),
    checks: Sequence[Check] = (),
    text: str = "",
    *,
    title: str = "",
    written: Sequence[Path] = (),
) -> bool:
    """Print the figures as JSON if requested, or tables, text, checks and files; report broken checks.

    Parameters
    ----------
    options : Namespace
        Of the command line.
    name : str
        Name of the command, for the message about broken checks.
    figures : mapping
        Results for JSON.
    tables : iterable of ResultTable
    checks : sequence of Check
    text : str
        Between tables and checks.
    title : str
        Title of the checks; default: the name.
    written : sequence of Path
        Files that were written.

    Returns
    -------
    bool
        True if no bound is broken.
    """
    if options.json:
        print_json(figures)
    else:
        for table in tables:
            runs.print_rows(*table)
        if text:
            terminal_console().print(text)
        if checks:
            print_checks(title or name, checks, options.verbose)
        runs.print_written(written)
    return report_broken(name, checks)


def print_message(line: str) -> None:
    """Print a line on stderr: stdout is for the results."""
    print(f"spheretwin: {line}", file=sys.stderr, flush=True)


def warn(lines: Iterable[str]) -> None:
    """Print warnings on stderr, one line each."""
    for line in lines:
        print_message(f"warning: {line}")


def warn_about_model(path: Path) -> None:
    """Print the warnings of the engine about a model file."""
    warn(mjcf.read(path).warnings)


def report_broken(source: str, checks: Iterable[Check]) -> bool:
    """Print the names of broken checks on stderr; return True if every check is within its bound."""
    names = broken(checks)
    if names:
        print_message(f"{source}: broken: {'; '.join(names)}")
    return not names


def _plain(value: Any) -> Any:
    """Return a value in JSON types; values that are not finite become null."""
    if isinstance(value, Check):
        return value.row()
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def keep_viewer(stop_requested: Callable[[], bool]) -> None:
    """Serve a live view after its run, until Ctrl-C; without a terminal nobody would press it."""
    if sys.stderr.isatty():
        print("the run has ended; Ctrl-C closes the viewer", file=sys.stderr, flush=True)
        while not stop_requested():
            time.sleep(0.1)


HINT_s = 1.0
"""Time after the first signal until a line explains the effect of a second one."""

SALVAGE_s = 5.0
"""Longest time that the second signal waits for files to be flushed."""

SIGNAL_EXIT = 128
"""Exit code of a process that a signal ended is this and the number of the signal, as shells have it."""


@contextlib.contextmanager
def interruptible(remark: str = "") -> Iterator[Callable[[], bool]]:
    """Yield a function that is True once Ctrl-C, or the end of the session, has requested a stop.

    A second signal ends the process at once, with exit code 130 after Ctrl-C and 143 after SIGTERM, also
    while compiled code runs: a law may never return. Rows that wait in memory are flushed before, and each
    partial file is named with the command that recovers it.

    Parameters
    ----------
    remark : str
        Additional line of that message.
    """
    requests: list[int] = []
    # Signals that the parent process ignores, such as SIGHUP with nohup, stay ignored.
    handled = [number for number in _ENDINGS if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, lambda number, _: requests.append(number)) for number in handled}
    try:
        with _watched(handled, remark):
            yield lambda: bool(requests)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def ending_signals(module: Any = signal) -> list[int]:
    """Return the signals that request the end of a process: Windows has no SIGHUP, others no SIGBREAK."""
    return [
        getattr(module, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(module, name)
    ]


_ENDINGS = ending_signals()


@contextlib.contextmanager
def _watched(handled: Collection[int], remark: str) -> Iterator[None]:
    """Count signals in a thread, as the main thread runs no Python while it is in compiled code."""
    reading, writing = socket.socketpair()  # on Windows, signals are written to sockets alone
    writing.setblocking(False)
    before = signal.set_wakeup_fd(writing.fileno(), warn_on_full_buffer=False)
    thread = threading.Thread(target=_watch, args=(reading, handled, remark), name="signals", daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        writing.close()
        thread.join()


def _watch(reading: socket.socket, handled: Collection[int], remark: str) -> None:
    """Read the numbers of signals until the other end is closed."""
    count = 0
    with reading:
        while True:
            try:
                numbers = reading.recv(64)
            except TimeoutError:
                _print("a stop is requested; a second Ctrl-C or SIGTERM ends the process at once")
                reading.settimeout(None)
                continue
            if not numbers:
                return
            for number in filter(handled.__contains__, numbers):
                count += 1
                if count == 1:
                    reading.settimeout(HINT_s)
                else:
                    _end(number, remark)


def _end(number: int, remark: str) -> None:
    """End the process at once."""
    partial: list[PartialFile] = []
    salvage = threading.Thread(target=lambda: partial.extend(OPEN_FILES.partial()), daemon=True)
    salvage.start()
    salvage.join(SALVAGE_s)
    lines = [f"ended at once by a second signal, {signal.Signals(number).name}"]
    for file in partial:
        command = shlex.join(["spheretwin", "recover", str(file.path), "--out", str(file.target)])
        lines.append(f"not complete: {file.target}; {file.rows} rows can be recovered: {command}")
    _print(*lines, *filter(None, [remark]))
    os._exit(SIGNAL_EXIT + number)


def _print(*lines: str) -> None:
    """Write lines to stderr, past the lock of a stream that the main thread may hold."""
    with contextlib.suppress(OSError):
        os.write(2, "".join(f"spheretwin: {line}\n" for line in lines).encode(errors="backslashreplace"))
