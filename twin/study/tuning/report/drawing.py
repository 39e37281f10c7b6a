"""What is drawn of a tuning: its objectives over the trials, and the front of two."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.twin.study.tuning.running import Found, OfLaw
from spheretwin.twin.study.tuning.section import Objective
from spheretwin.twin.study.tuning.trial import Ended
from spheretwin.viz.figures import tuning
from spheretwin.viz.figures.drawing import Drawing


def drawings(name: str, found: Found, objectives: Sequence[Objective]) -> list[Drawing]:
    """Figures of a tuning; none of one without a trial."""
    by_label = {law.law: _trials(law, objectives) for law in found.laws if law.kept}
    if not by_label:
        return []
    names = [each.called for each in objectives]
    drawn = [
        Drawing(
            "trials.png",
            "Objectives trial by trial: rings were pruned, and are at least that; crosses lost.",
            tuning.progress(by_label, names, f"{name}: trials"),
        )
    ]
    if len(objectives) == 2:
        caption = "The front: no trial is as good in both objectives and better in one."
        drawn.append(Drawing("front.png", caption, tuning.front(by_label, names, f"{name}: front")))
    return drawn


def _trials(law: OfLaw, objectives: Sequence[Objective]) -> tuning.Trials:
    signs = np.array([each.sign for each in objectives])
    best = {each.kept.number for each in law.best}
    lost = [np.nan] * len(objectives)
    values = [lost if each.tried.ended == Ended.LOST else each.tried.values for each in law.kept]
    fresh = [each.fresh.values for each in law.best if each.fresh and each.fresh.values]
    return tuning.Trials(
        law=law.law,
        numbers=np.array([float(each.number) for each in law.kept]),
        values=signs * np.array(values, dtype=float),
        completed=np.array([each.tried.ended == Ended.COMPLETED for each in law.kept]),
        best=np.array([each.number in best for each in law.kept]),
        signs=signs,
        has_start=law.start is not None,
        fresh=signs * np.array(fresh, dtype=float).reshape(-1, len(objectives)),
    )
