"""A recording's file, written whole or not at all, and runs below paths of their own in it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from spheretwin.models.base.files import whole_file
from spheretwin.viz.recording.file_pipe import PIPE_PATHS, FilePipe


class Below:
    """A recording in which all that is logged stands below one path.

    Parameters
    ----------
    recording : RecordingStream
    path : str
        Without a slash at its end.
    """

    def __init__(self, recording: rr.RecordingStream, path: str) -> None:
        self._recording, self._path = recording, path

    def log(self, entity: str, *values: Any, **options: Any) -> None:
        """Log below the path."""
        self._recording.log(f"{self._path}/{entity}", *values, **options)

    def send_columns(self, entity: str, indexes: Any, columns: Any) -> None:
        """Send many rows below the path."""
        self._recording.send_columns(f"{self._path}/{entity}", indexes, columns)

    def flush(self) -> None:
        """Send what is not yet sent."""
        self._recording.flush()


@contextmanager
def recorded(path: Path, application: str, layout: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """Give a stream whose recording takes the name `path` when the block ends well.

    Parameters
    ----------
    path : Path
    application : str
        A viewer keeps one layout for each.
    layout : Blueprint

    Raises
    ------
    InputError
        No file can be made there.
    SpheretwinError
        Writing failed; what was at `path` before is untouched.
    """
    rr.set_strict_mode(True)  # otherwise a mistake is a warning, and its data are dropped
    with whole_file(path) as temporary:
        pipe = FilePipe(temporary) if PIPE_PATHS.is_dir() else None
        stream = rr.RecordingStream(application)
        try:
            stream.set_log_time_enabled(False)  # simulated time is the only one that means anything
            stream.set_sinks(rr.FileSink(pipe.path if pipe else temporary), default_blueprint=layout)
            yield stream
            stream.flush()
        finally:
            stream.disconnect()
            if pipe:
                pipe.close()
        if pipe and pipe.error:
            raise pipe.error
