"""Announcement of a compilation: on a terminal alone, with a count and the time."""

import sys

import pytest

from spheretwin.models.base.compilation import report
from spheretwin.viz.terminal.compilation import PAUSE_s, announced


def test_a_terminal_gets_a_start_progress_and_an_end(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    times = iter([0.0, 1.0, PAUSE_s, PAUSE_s + 3.0])
    with announced(lambda: next(times)):
        for name in ("first", "second", "third"):
            report(name)
    first, second, third = capsys.readouterr().err.splitlines()
    assert "compiling the loop" in first
    assert second == "spheretwin: compiling: 2 functions, 5 s"
    assert third.startswith("spheretwin: 3 functions were compiled")


@pytest.mark.parametrize(("terminal", "names"), [(True, []), (False, ["first"])])
def test_nothing_is_said_of_machine_code_from_the_cache_or_to_a_pipe(monkeypatch, capsys, terminal, names):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    with announced():
        for name in names:
            report(name)
    assert capsys.readouterr().err == ""
