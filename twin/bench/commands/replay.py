"""Show a recorded run; the twin stands still meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from spheretwin.twin.bench.command import Text, command
from spheretwin.twin.bench.player import Player
from spheretwin.twin.bench.work.works import Works


def _read(works: Works, file: str) -> Callable[[], Player]:
    return lambda: Player(Path(file))


def _replay(works: Works, player: Player, file: str) -> None:
    works.player = player


REPLAY = command("replay", _replay, prepares=_read, arguments={"file": (Text, ...)})
