"""What a tuning found, as JSON holds it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from spheretwin.twin.study.tuning.running import Chosen, Found, OfLaw
from spheretwin.twin.study.tuning.section import Objective
from spheretwin.twin.study.tuning.trial import Ended


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
        "gains": dict(chosen.kept.chosen),
        "fields": dict(chosen.fields),
        "values": _signed(tried.values, objectives) if completed else None,
        "fresh": _signed(fresh.values, objectives) if fresh and fresh.values else None,
        "fresh_reason": (fresh.reason or None) if fresh else None,
        "command": chosen.command,
    }


def _signed(values: Sequence[float], objectives: Sequence[Objective]) -> dict[str, float]:
    pairs = zip(objectives, values, strict=True)
    return {objective.called: objective.sign * value for objective, value in pairs}
