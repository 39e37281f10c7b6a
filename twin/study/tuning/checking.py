"""What can be found out about a tuning before its first trial."""

from __future__ import annotations

import math
from collections.abc import Sequence

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import is_reference
from spheretwin.models.base.wording import did_you_mean, shown
from spheretwin.twin.metrics.registry import METRICS
from spheretwin.twin.study.grid import Row
from spheretwin.twin.study.row import Rows
from spheretwin.twin.study.study import Study
from spheretwin.twin.study.tuning import gains
from spheretwin.twin.study.tuning.section import Gain
from spheretwin.twin.study.tuning.trial import with_fields


def judged(study: Study) -> Study:
    """A study of the figures alone that its trials are judged by.

    Raises
    ------
    InputError
        An objective is no figure of the study.
    """
    own = {each.rpartition(":")[2]: each for each in study.metrics if is_reference(each)}
    names: dict[str, None] = {}
    for objective in gains.section_of(study).objective:
        if objective.metric not in METRICS and objective.metric not in own:
            valid = [*METRICS, *own]
            raise InputError(
                f"study {study.name}: expected {', '.join(valid)} as an objective,"
                f" received {shown(objective.metric)}{did_you_mean(objective.metric, valid)}"
            )
        names[own.get(objective.metric, objective.metric)] = None
    return study.model_copy(
        update={"metrics": tuple(names), "telemetry": (), "optimise": None, "description": ""}
    )


def check(study: Study, rows: Rows, laws: Sequence[tuple[Sequence[Gain], Row]]) -> None:
    """Find out whether each law runs with its gains, from those that it starts with on.

    Raises
    ------
    InputError
        A gain sets no field or has no law, or the values that it starts with make no scenario.
    """
    gains.check_laws(study, rows)
    for of_law, row in laws:
        rows.scenario(with_fields(row, gains.values(of_law, middle(of_law))))


def middle(of_law: Sequence[Gain]) -> dict[str, float]:
    """Values that gains start with, or those in the middle of their ranges where none are said."""
    return gains.start_of(of_law) or {each.called: _middle(each) for each in of_law}


def _middle(gain: Gain) -> float:
    return math.sqrt(gain.low * gain.high) if gain.log else (gain.low + gain.high) / 2
