"""What the controller does about faults: the ways in which each of them is run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class Way(NamedTuple):
    """One way to meet a fault."""

    name: str
    of_fault: Mapping[str, Any] = {}
    """Fields of every fault."""
    fields: Mapping[str, Any] = {}
    """Fields of the scenario."""


NOT_TOLD = Way("not told")
TOLD = Way("told", {"known": True})
DETECTING = Way("detecting", {"detect": True})
BOUNDED = Way("told, bounded", {"known": True}, {"allocation": "bounded"})

OF_GROUPS = (NOT_TOLD, TOLD, DETECTING, BOUNDED)
"""For open groups: nobody says so, the allocation is told, or the detector finds them. And told once
more, with the allocation that uses all that the current limit allows."""

ALONE = Way("no watchdog", fields={"watchdog.on": False})
RELEASE = Way("release", fields={"watchdog.on": True, "watchdog.action": "release"})
BRAKE = Way("short", fields={"watchdog.on": True, "watchdog.action": "short"})

OF_PARTS = (ALONE, RELEASE, BRAKE)
"""For parts that all groups share there is nothing to leave out: no watchdog, or one by what it does."""
