"""What is kept: recordings, the settings as a file, and snapshots to go back to."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import whole_file
from spheretwin.twin.bench.command import Text, command
from spheretwin.twin.bench.keeping import Files
from spheretwin.twin.bench.work.works import Works
from spheretwin.twin.scenario.writing import as_toml


def _snapshot(works: Works, _: None, name: str) -> None:
    works.desk.snapshot(name)


def _restore(works: Works, _: None, name: str) -> None:
    end = works.recording.ending(works.desk.session)  # as it is before time goes back
    works.desk.restore(name)
    works.went_back(end)


def _opened(works: Works, recording: str | None, telemetry: str | None) -> Callable[[], Files]:
    paths = [Path(path) if path else None for path in (recording, telemetry)]
    return lambda: Files(works.desk.session, *paths)


def _record(works: Works, files: Files, recording: str | None, telemetry: str | None) -> None:
    if works.recording.on or works.desk.reason is not None:
        files.discard()
        raise InputError(
            "bench: expected keep before the next recording, received record"
            if works.recording.on
            else "bench: expected a run that goes on, received record after its end"
        )
    works.recording.begin(files, works.desk)


def _keep(works: Works, _: None) -> None:
    if not works.recording.on:
        raise InputError("bench: expected a recording to keep, received none")
    works.recording.end(works.desk.session, None)


def _written(works: Works, file: str) -> Callable[[], None]:
    settings = works.desk.settings

    def write() -> None:
        with whole_file(Path(file)) as temporary:
            temporary.write_text(as_toml(settings), encoding="utf-8")

    return write


def _save(works: Works, _: None, file: str) -> None:
    """What is prepared is all of it."""


SNAPSHOT = command("snapshot", _snapshot, arguments={"name": (Text, "last")})
RESTORE = command("restore", _restore, arguments={"name": (Text, "last")})
RECORD = command(
    "record",
    _record,
    prepares=_opened,
    arguments={"recording": (Text | None, None), "telemetry": (Text | None, None)},
)
KEEP = command("keep", _keep, only_last=())
SAVE = command("save", _save, prepares=_written, arguments={"file": (Text, ...)})
