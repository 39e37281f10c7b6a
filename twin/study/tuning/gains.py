"""The gains of each law of a study: the fields that follow from them, and what can be told before a trial."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from spheretwin.metrics import METRICS
from spheretwin.models.base.errors import InputError, did_you_mean, shown
from spheretwin.models.base.user_code import is_reference
from spheretwin.study.grid import Row
from spheretwin.study.optimise import ON, Gain, Optimise
from spheretwin.study.row import Rows
from spheretwin.study.study import Study
from spheretwin.study.tuning.trials import with_fields


def section_of(study: Study) -> Optimise:
    """What a study says of its tuning.

    Raises
    ------
    InputError
        It says nothing, or gains that it cannot have.
    """
    if study.optimise is None:
        raise InputError(f"study {study.name}: expected [optimise] in a study that is tuned, received none")
    taken = {"seed", "controller.law", *study.fields, *(axis.field for axis in study.axis)}
    for gain in study.optimise.gain:
        for setting in gain.settings:
            if setting.field in taken:
                raise InputError(
                    f"study {study.name}: expected {setting.field} as a gain alone,"
                    " received it among the fields or axes too"
                )
    return study.optimise


def called(law: Mapping[str, Any] | None, rows: Rows) -> str:
    """Name of a law as tables have it: its own alone where nothing else is said of it."""
    if law is None:
        return rows.base.controller.law
    return str(law["law"]) if set(law) == {"law"} else json.dumps(law, sort_keys=True)


def gains_of(study: Study, law: Mapping[str, Any] | None, rows: Rows) -> tuple[Gain, ...]:
    """Gains that a law has.

    Raises
    ------
    InputError
        None, two of one name, some of which start and some do not, or one that a study says otherwise.
    """
    name = rows.base.controller.law if law is None else str(law["law"])
    gains = tuple(each for each in section_of(study).gain if each.law in ("", name))
    if not gains:
        raise InputError(f"study {study.name}: expected gains of {name}, received none")
    names = [each.called for each in gains]
    if twice := [each for each in names if names.count(each) > 1]:
        raise InputError(f"study {study.name}: expected gains of different names, received {twice[0]} twice")
    starts = [each.called for each in gains if each.start is not None]
    if 0 < len(starts) < len(gains):
        missing = next(each for each in names if each not in starts)
        raise InputError(
            f"study {study.name}: expected start of every gain of {name}, received none of {missing}"
        )
    fixed = {f"controller.{each}" for each in law or {}}
    if both := [each for each in values(gains, dict.fromkeys(names, 1.0)) if each in fixed]:
        raise InputError(f"study {study.name}: expected {both[0]} in [[law]] or as a gain, received both")
    return gains


def check_laws(study: Study, rows: Rows) -> None:
    """Find out whether each gain is of a law of the study.

    Raises
    ------
    InputError
        One is not.
    """
    laws = [str(law["law"]) for law in study.law] or [rows.base.controller.law]
    for gain in section_of(study).gain:
        if gain.law and gain.law not in laws:
            raise InputError(
                f"study {study.name}: expected {', '.join(laws)} as the law of a gain,"
                f" received {gain.law}{did_you_mean(gain.law, laws)}"
            )


def values(gains: Sequence[Gain], chosen: Mapping[str, float]) -> dict[str, float]:
    """Value of every field that some gains set.

    Parameters
    ----------
    gains : sequence of Gain
    chosen : mapping of a gain's name to float
    """
    found: dict[str, float] = {}
    for gain in gains:
        if chosen.get(gain.switch, ON) < ON:
            continue
        for setting in gain.settings:
            value = setting.factor * chosen[gain.called] ** setting.power
            found[setting.field] = found.get(setting.field, 1.0) * value
    return found


def numbers(gains: Sequence[Gain]) -> dict[str, tuple[float, float, bool]]:
    """Numbers that a trial chooses: lowest, highest and whether on a logarithmic scale, by name."""
    ranges = {each.called: (each.low, each.high, each.log) for each in gains}
    return ranges | {each.switch: (0.0, 1.0, False) for each in gains if each.optional}


def start_of(gains: Sequence[Gain]) -> dict[str, float] | None:
    """Values of the first trial; None where none are said."""
    starts = {each.called: each.start for each in gains if each.start is not None}
    return starts if len(starts) == len(gains) else None


def judged(study: Study) -> Study:
    """A study of the figures alone that its trials are judged by.

    Raises
    ------
    InputError
        An objective is no figure of the study.
    """
    own = {each.rpartition(":")[2]: each for each in study.metrics if is_reference(each)}
    names: dict[str, None] = {}
    for objective in section_of(study).objective:
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
    check_laws(study, rows)
    for of_law, row in laws:
        rows.scenario(with_fields(row, values(of_law, middle(of_law))))


def middle(of_law: Sequence[Gain]) -> dict[str, float]:
    """Values that gains start with, or those in the middle of their ranges where none are said."""
    return start_of(of_law) or {each.called: _middle(each) for each in of_law}


def _middle(gain: Gain) -> float:
    return math.sqrt(gain.low * gain.high) if gain.log else (gain.low + gain.high) / 2
