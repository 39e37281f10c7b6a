"""What a tuning found, as JSON holds it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from spheretwin.twin.study.tuning.objectives import best_within
from spheretwin.twin.study.tuning.running import Chosen, Found, OfLaw
from spheretwin.twin.study.tuning.section import ON, SWITCH, Objective
from spheretwin.twin.study.tuning.trial import Ended

KEPT = ("trial", "gains", "fields", "values")
"""What the file of the gains found has of a trial."""


def told(found: Found, objectives: Sequence[Objective]) -> dict[str, Any]:
    """What was found: of each law how its trials ended, its start, and its best or its front."""
    return {
        "objectives": [each.model_dump(mode="json") for each in objectives],
        "laws": {law.law: _of_law(law, objectives) for law in found.laws},
        "trials": found.trials,
        "of": found.of,
        "resumed": found.resumed,
        "wall_s": found.wall_s,
        "table": str(found.table),
    }


def best(found: Found, objectives: Sequence[Objective]) -> dict[str, Any]:
    """Gains found: of each law its best trial, that within each limit, or the trials of the front."""
    return {"laws": {law.law: _best_of(law, objectives) for law in found.laws}}


def _best_of(law: OfLaw, objectives: Sequence[Objective]) -> list[dict[str, Any]]:
    by_number = {each.kept.number: each for each in law.best}
    values = {number: each.kept.tried.values for number, each in by_number.items()}
    limits = objectives[-1].limits
    numbers: list[tuple[float | None, int | None]] = [(limit, best_within(values, limit)) for limit in limits]
    return [
        {"limit": limit, **{name: _chosen(by_number[number], objectives)[name] for name in KEPT}}
        for limit, number in (numbers if limits else [(None, number) for number in by_number])
        if number is not None
    ]


def _of_law(law: OfLaw, objectives: Sequence[Objective]) -> dict[str, Any]:
    counts = Counter(each.tried.ended for each in law.kept)
    lost = [each.tried.reason for each in law.kept if each.tried.ended == Ended.LOST]
    return {
        "ended": {str(each): counts[each] for each in Ended},
        "lost": lost[0] if lost else None,
        "rows": sum(len(each.tried.each) for each in law.kept),
        "start": _chosen(law.start, objectives) if law.start else None,
        "best": [_chosen(each, objectives) for each in law.best],
    }


def _chosen(chosen: Chosen, objectives: Sequence[Objective]) -> dict[str, Any]:
    tried, fresh = chosen.kept.tried, chosen.fresh
    completed = tried.ended == Ended.COMPLETED
    return {
        "trial": chosen.kept.number,
        "ended": str(tried.ended),
        "reason": tried.reason or None,
        "gains": _gains(chosen.kept.chosen),
        "fields": dict(chosen.fields),
        "values": _signed(tried.values, objectives) if completed else None,
        "fresh": _signed(fresh.values, objectives) if fresh and fresh.values else None,
        "fresh_reason": (fresh.reason or None) if fresh else None,
        "command": chosen.command,
    }


def _gains(chosen: Mapping[str, float]) -> dict[str, float | None]:
    """Values by gain; None of an optional one that is off."""
    is_on = {
        name.removesuffix(SWITCH): value >= ON for name, value in chosen.items() if name.endswith(SWITCH)
    }
    return {
        name: value if is_on.get(name, True) else None
        for name, value in chosen.items()
        if not name.endswith(SWITCH)
    }


def _signed(values: Sequence[float], objectives: Sequence[Objective]) -> dict[str, float]:
    pairs = zip(objectives, values, strict=True)
    return {objective.called: objective.sign * value for objective, value in pairs}
