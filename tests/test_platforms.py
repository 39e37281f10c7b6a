"""Branches for other systems, on this one: each test simulates what the other system has or lacks."""

import signal
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from spheretwin.cli import common
from spheretwin.machine.link.transports import open_transport
from spheretwin.models.base.errors import InputError
from spheretwin.study import journal
from spheretwin.viz.terminal import runs


def test_the_signals_are_those_that_the_system_has():
    windows = SimpleNamespace(SIGINT=2, SIGTERM=15, SIGBREAK=21)
    assert common.ending_signals(windows) == [2, 15, 21]
    unix = SimpleNamespace(SIGINT=2, SIGTERM=15, SIGHUP=1)
    assert common.ending_signals(unix) == [2, 15, 1]
    assert signal.SIGINT in common.ending_signals()


class File:
    """A file of a system in which any place can be sought."""

    def __init__(self):
        self.place = 5

    def tell(self):
        return self.place

    def seek(self, place):
        self.place = place

    def fileno(self):
        return 3


def locked_by(monkeypatch, locking):
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(journal, "msvcrt", SimpleNamespace(LK_NBLCK=2, locking=locking), raising=False)
    return File()


def test_a_lock_of_windows_is_beyond_the_end_of_the_file(monkeypatch):
    locked = []
    file = locked_by(monkeypatch, lambda *given: locked.append((*given, file.place)))
    journal.lock(file)
    assert locked == [(3, 2, 1, journal.BEYOND)]
    assert file.place == 5  # the next line goes to the end


def test_a_lock_of_windows_that_is_taken_is_an_error(monkeypatch):
    def locking(number, mode, length):
        raise PermissionError("taken")

    file = locked_by(monkeypatch, locking)
    with pytest.raises(PermissionError, match="taken"):
        journal.lock(file)
    assert file.place == 5


@pytest.mark.parametrize(
    ("platform", "name"), [("win32", "rerun.exe"), ("linux", "rerun"), ("darwin", "rerun")]
)
def test_the_viewer_has_the_name_of_the_system(platform, name, monkeypatch, tmp_path):
    (tmp_path / name).touch()
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    monkeypatch.setattr(runs.shutil, "which", lambda program: None)
    assert Path(runs.rerun_command()).name == name


@pytest.mark.parametrize("address", ["-", "serial:COM3@115200"])
def test_windows_refuses_what_select_cannot_wait_for(address, monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(InputError, match="expected udp://HOST:PORT on Windows"):
        open_transport(address)
