"""One chunk of a bench: ticks are run, or rows of a recorded run shown, and handed on."""

from __future__ import annotations

import time

from spheretwin.twin.bench.player import Player
from spheretwin.twin.bench.work.works import Works


def run(works: Works, ticks: int) -> int:
    """Run some ticks, no more than are asked for while paused; returns how many were run."""
    if not works.running:
        ticks = min(ticks, works.steps)
    if ticks < 1:
        return 0
    began = time.monotonic()
    done = _play(works, works.player, ticks) if works.player else _simulate(works, ticks)
    works.steps -= min(done, works.steps)
    works.pace.ran(done, works.period_s, works.t_s, time.monotonic() - began)
    return done


def _play(works: Works, player: Player, ticks: int) -> int:
    done = player.advance(ticks)
    if player.over:
        works.pause()
    return done


def _simulate(works: Works, ticks: int) -> int:
    desk, recording, done = works.desk, works.recording, 0
    recording.note_changes(desk.session)
    while done < ticks and desk.reason is None:
        first = desk.session.tick
        rows = desk.advance(ticks - done)
        if rows is not None and len(rows):
            done += len(rows)
            works.history.write(first, rows)
            recording.write(rows)
        recording.note_changes(desk.session)
    if desk.reason is not None:
        works.pause()
        recording.end(desk.session, "the recording has ended: so has the run")
    return done
