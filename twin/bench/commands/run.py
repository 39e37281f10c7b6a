"""Time goes on, or not; a run ends by STOP, and another one is begun."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import Field, JsonValue

from spheretwin.models.base.errors import InputError
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.bench.command import By, Text, command
from spheretwin.twin.bench.pace import FASTEST, SLOWEST
from spheretwin.twin.bench.work.works import Works
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.session import Session

Speed = Annotated[float, Field(ge=SLOWEST, le=FASTEST)]
Ticks = Annotated[int, Field(ge=1, le=1_000_000)]

Begun = tuple[Scenario, Session]


def _start(works: Works, _: None) -> None:
    works.check_going("start")
    works.running = True


def _pause(works: Works, _: None) -> None:
    works.pause()


def _step(works: Works, _: None, ticks: int) -> None:
    works.check_going("step")
    if works.running:
        raise InputError("bench: expected step while paused, received it while time goes on")
    works.steps += ticks


def _speed(works: Works, _: None, factor: float) -> None:
    works.pace.speed = factor
    works.pace.rest()


def _stop(works: Works, _: None) -> None:
    works.player, works.note = None, "STOP: currents are taken away until reset"
    works.desk.stop()


def _begun_anew(works: Works, ready: Begun, **given: Any) -> None:
    recorded = works.recording.on
    works.recording.end(works.desk.session, None)
    works.desk.session.close()
    works.begin(*ready)
    works.note = "the recording has ended: the run was begun anew" if recorded else None


def _present(works: Works) -> Callable[[], Begun]:
    settings = works.desk.settings
    return lambda: (settings, Session(settings))


def _another(works: Works, source: str, overrides: dict[str, Any]) -> Callable[[], Begun]:
    def load() -> Begun:
        scenario = scenarios.load(source, overrides)
        return scenario, Session(scenario)

    return load


START = command("start", _start, only_last=(), undone=True)
PAUSE = command("pause", _pause, only_last=())
STEP = command("step", _step, undone=True, arguments={"ticks": (Ticks, 1)})
SPEED = command("speed", _speed, only_last=(), arguments={"factor": (Speed, ...)})
STOP = command("stop", _stop, by=By.ANYONE, before_all=True)
RESET = command("reset", _begun_anew, only_last=(), prepares=_present, undone=True)
LOAD = command(
    "load",
    _begun_anew,
    prepares=_another,
    undone=True,
    arguments={"source": (Text, ...), "overrides": (dict[str, JsonValue], {})},
)
