"""Announcement of a compilation: on a terminal alone, with a count and the time."""

import sys

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


def test_nothing_is_said_of_machine_code_from_the_cache(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with announced():
        pass
    assert capsys.readouterr().err == ""


def test_files_and_pipes_get_nothing(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: False)
    with announced():
        report("first")
    assert capsys.readouterr().err == ""
