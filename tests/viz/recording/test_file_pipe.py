"""Pipe between Rerun and a file: errors of the file are kept, and nothing waits for it."""

import errno
import io
import os
from pathlib import Path

import pytest

from spheretwin.viz.recording.recorder import FilePipe

# More than any pipe holds (64 kB unless told otherwise), so that a writer waits unless somebody reads.
BYTES = os.urandom(1 << 20)


def through(pipe):
    with pipe.path.open("wb") as file:
        file.write(BYTES)
    pipe.close()


def failing(name):
    """A class of files one method of which finds the disk full."""

    def fail(self, *_):
        if name == "close":
            io.FileIO.close(self)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    return type("Failing", (io.FileIO,), {name: fail, "__exit__": lambda self, *_: self.close()})


def test_all_bytes_reach_the_file(tmp_path):
    pipe = FilePipe(tmp_path / "file")
    through(pipe)
    assert pipe.error is None
    assert (tmp_path / "file").read_bytes() == BYTES


def test_a_file_that_cannot_be_opened_is_reported_at_once(tmp_path):
    open_files = len(os.listdir("/dev/fd"))
    with pytest.raises(FileNotFoundError):
        FilePipe(tmp_path / "missing" / "file")
    assert len(os.listdir("/dev/fd")) == open_files


@pytest.mark.parametrize("name", ["write", "close"])
def test_an_error_is_kept_and_the_pipe_is_emptied(tmp_path, monkeypatch, name):
    kind = failing(name)
    monkeypatch.setattr(Path, "open", lambda path, mode, buffering=-1: kind(path, "w"))
    pipe = FilePipe(tmp_path / "file")
    monkeypatch.undo()
    through(pipe)
    assert pipe.error is not None
    assert pipe.error.errno == errno.ENOSPC
