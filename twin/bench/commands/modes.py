"""What the twin does: it is free, follows a law, or has currents by hand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import Field, JsonValue

from spheretwin.twin.bench.command import Place, command
from spheretwin.twin.bench.desk import Desk
from spheretwin.twin.bench.work.works import Works
from spheretwin.twin.trajectories.trajectory import Triple

Current = Annotated[float, Field(ge=-1e3, le=1e3)]


def _mode(way: Callable[..., None]) -> Callable[..., None]:
    """Go over to a mode of the desk's; a recorded run is shown no more."""

    def does(works: Works, _: None, **given: Any) -> None:
        way(works.desk, **given)
        works.player = None

    return does


OFF = command("off", _mode(Desk.off), only_last=())
HOLD = command("hold", _mode(Desk.hold), only_last=())
POINT = command("point", _mode(Desk.point), only_last=(), arguments={"pose_rad": (Triple, ...)})
TRAJECTORY = command(
    "trajectory",
    _mode(Desk.trajectory),
    only_last=(),
    arguments={"fields": (dict[str, JsonValue] | None, None)},
)
JOG = command("jog", _mode(Desk.jog), only_last=(), arguments={"rates_rad_s": (Triple, ...)})
MANUAL = command(
    "manual",
    _mode(Desk.manual),
    only_last=(),
    arguments={
        "currents_A": (tuple[Current, ...] | None, None),
        "group": (Place | None, None),
        "current_A": (Current, 1.0),
    },
)
