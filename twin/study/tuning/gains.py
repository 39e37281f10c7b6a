"""Gains of each law of a study: their fields, ranges and start, and the checks before the first trial."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from spheretwin.metrics import METRICS
from spheretwin.models.base.errors import InputError, did_you_mean, unknown_name
from spheretwin.models.base.user_code import is_reference
from spheretwin.study.grid import Row
from spheretwin.study.optimise import ON, Gain, Optimise
from spheretwin.study.row import Rows
from spheretwin.study.study import Study
from spheretwin.study.table import law_text
from spheretwin.study.tuning.trials import with_fields


def section_of(study: Study) -> Optimise:
    """Section [optimise] of a study.

    Raises
    ------
    InputError
        The study has none, or a gain conflicts with its fields or axes.
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
    """Label of a law in tables: its name alone if it has no other fields."""
    return rows.base.controller.law if law is None else law_text(law)


def gains_of(study: Study, law: Mapping[str, Any] | None, rows: Rows) -> tuple[Gain, ...]:
    """Gains that a law has.

    Raises
    ------
    InputError
        There is none, two have one name, only some have a start, or the law fixes a gain.
    """
    name = rows.base.controller.law if law is None else str(law["law"])
    gains = tuple(gain for gain in section_of(study).gain if gain.law in ("", name))
    if not gains:
        raise InputError(f"study {study.name}: expected gains of {name}, received none")
    names = [gain.called for gain in gains]
    if twice := [gain for gain in names if names.count(gain) > 1]:
        raise InputError(f"study {study.name}: expected gains of different names, received {twice[0]} twice")
    starts = [gain.called for gain in gains if gain.start is not None]
    if 0 < len(starts) < len(gains):
        missing = next(gain for gain in names if gain not in starts)
        raise InputError(
            f"study {study.name}: expected start of every gain of {name}, received none of {missing}"
        )
    fixed = {f"controller.{field}" for field in law or {}}
    if both := [field for field in values(gains, dict.fromkeys(names, 1.0)) if field in fixed]:
        raise InputError(f"study {study.name}: expected {both[0]} in [[law]] or as a gain, received both")
    return gains


def check_laws(study: Study, rows: Rows) -> None:
    """Check that each gain is of a law of the study.

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
    fields: dict[str, float] = {}
    for gain in gains:
        if chosen.get(gain.switch, ON) < ON:
            continue
        for setting in gain.settings:
            value = setting.factor * chosen[gain.called] ** setting.power
            fields[setting.field] = fields.get(setting.field, 1.0) * value
    return fields


def numbers(gains: Sequence[Gain]) -> dict[str, tuple[float, float, bool]]:
    """Numbers that a trial chooses: lowest, highest and whether on a logarithmic scale, by name."""
    ranges = {gain.called: (gain.low, gain.high, gain.log) for gain in gains}
    return ranges | {gain.switch: (0.0, 1.0, False) for gain in gains if gain.optional}


def start_of(gains: Sequence[Gain]) -> dict[str, float] | None:
    """Values of the first trial; None if the gains have none."""
    starts = {gain.called: gain.start for gain in gains if gain.start is not None}
    return starts if len(starts) == len(gains) else None


def judged(study: Study) -> Study:
    """Study with the figures of the objectives alone.

    Raises
    ------
    InputError
        An objective is no figure of the study.
    """
    own = {name.rpartition(":")[2]: name for name in study.metrics if is_reference(name)}
    names: dict[str, None] = {}
    for objective in section_of(study).objective:
        if objective.metric not in METRICS and objective.metric not in own:
            valid = [*METRICS, *own]
            raise unknown_name(f"study {study.name}", objective.metric, valid, "{} as an objective")
        names[own.get(objective.metric, objective.metric)] = None
    return study.model_copy(
        update={"metrics": tuple(names), "telemetry": (), "optimise": None, "description": ""}
    )


def check(study: Study, rows: Rows, laws: Sequence[tuple[Sequence[Gain], Row]]) -> None:
    """Check that each law runs with the start of its gains.

    Raises
    ------
    InputError
        A gain sets no field or has no law, or its start makes no scenario.
    """
    check_laws(study, rows)
    for of_law, row in laws:
        rows.scenario(with_fields(row, values(of_law, middle(of_law))))


def middle(of_law: Sequence[Gain]) -> dict[str, float]:
    """Start of the gains, or the middle of their ranges without one."""
    return start_of(of_law) or {gain.called: _middle(gain) for gain in of_law}


def _middle(gain: Gain) -> float:
    return math.sqrt(gain.low * gain.high) if gain.log else (gain.low + gain.high) / 2
