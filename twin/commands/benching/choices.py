"""What a bench's page offers: every field of the run, read and shown as the command line does."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Literal, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from spheretwin.control.laws.registry import LAWS
from spheretwin.models.base.errors import InputError
from spheretwin.twin.bench import Bench
from spheretwin.twin.bench.modes import Limits
from spheretwin.twin.faults.targets.registry import TARGETS
from spheretwin.twin.scenario import flags
from spheretwin.twin.scenario.fields import every_field, kind_of
from spheretwin.twin.scenario.reading import shipped
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.trajectories.registry import SHAPES
from spheretwin.viz.bench.machine import Choices, Setting

TRAJECTORY = "trajectory"

# What tells the shapes apart, and the way to a shape, which the bench makes.
NO_SHAPE = ("shape", "approach")


def choices_of(bench: Bench) -> Choices:
    """All that a page of a bench offers."""
    groups = len(bench.actuator.groups)
    return Choices(
        settings=lambda: settings_of(bench.fields()),
        shape=lambda name: shape_settings(name, bench),
        read=read,
        scenarios=shipped(),
        shapes=tuple(SHAPES),
        laws=tuple(LAWS),
        limits=Limits(),
        targets={name: tuple(target.modes) for target in TARGETS.values() for name in target.names(groups)},
    )


def settings_of(fields: list[tuple[str, Any, str]]) -> list[Setting]:
    """Fields of a run, with what they may be."""
    values = {name: value for name, value, _ in fields}
    return [_setting(name, value, meaning, values) for name, value, meaning in fields]


def shape_settings(name: str, bench: Bench) -> list[Setting]:
    """Fields of a shape: those of the present one as they are, of another as they come."""
    present = {
        dotted.partition(".")[2]: value
        for dotted, value, _ in bench.fields()
        if dotted.startswith(f"{TRAJECTORY}.")
    }
    kind = SHAPES.get(name)
    if kind is None:
        return []
    known = _gathered(present) if present.get("shape") == name else {}
    return [
        Setting(
            field,
            written(known.get(field, _default(info))),
            written(_default(info)),
            _meaning(info.description or "", info),
            _literals(info.annotation),
        )
        for field, info in kind.model_fields.items()
        if field not in NO_SHAPE
    ]


def written(value: Any) -> str:
    """A value as the command line takes it, to its last digit; nothing for one that is not given."""
    if isinstance(value, tuple) and not any(isinstance(each, tuple) for each in value):
        return " ".join(map(written, value))
    if isinstance(value, tuple | dict | list | bool):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, float):
        short = f"{value:g}"
        return short if float(short) == value else repr(value)
    return "" if value is None else str(value)


def read(name: str, text: str) -> Any:
    """Value of a text, as the command line reads it; None for an empty one.

    Raises
    ------
    InputError
        A quotation is not closed.
    """
    text = text.strip()
    if not text:
        return None
    try:
        tokens = [text] if text[0] in "[{" else shlex.split(text)
    except ValueError as error:
        raise InputError(f"{name}: expected a value, received {text}: {error}") from None
    if any(token.startswith("--") for token in tokens):
        raise InputError(f"{name}: expected a value, received {text}")
    return flags.overrides([f"--{name}", *tokens])[name]


def _gathered(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a shape, those in lists of tables as one list each."""
    found: dict[str, Any] = {}
    for dotted, value in fields.items():
        name, _, inside = dotted.partition(".")
        place, _, last = inside.partition(".")
        if not inside:
            found[name] = value
        elif place.isdigit():
            rows = found.setdefault(name, [])
            rows.extend({} for _ in range(int(place) + 1 - len(rows)))
            rows[int(place)][last] = value
    return found


def _setting(name: str, value: Any, meaning: str, values: Mapping[str, Any]) -> Setting:
    info = _field_of(name, values)
    default = written(_default(info)) if info else None
    choices = _families().get(_anywhere(name)) or (_literals(info.annotation) if info else ())
    return Setting(name, written(value), default, _meaning(meaning, info), choices)


@cache
def _families() -> dict[str, tuple[str, ...]]:
    return {
        f"{name}.{kind.told_apart_by}": tuple(kind.members)
        for name, field in every_field(Scenario)
        if (kind := kind_of(field)) and kind.told_apart_by
    }


def _anywhere(name: str) -> str:
    return ".".join("#" if part.isdigit() else part for part in name.split("."))


def _field_of(name: str, values: Mapping[str, Any]) -> FieldInfo | None:
    """Description of a field, of the member of each family that the values say; None for one that is own."""
    members: list[type[BaseModel]] = [Scenario]
    *inside, last = name.split(".")
    prefix, kind = "", None
    for part in inside:
        prefix += f"{part}."
        if not part.isdigit():
            field = next((each.model_fields[part] for each in members if part in each.model_fields), None)
            kind = kind_of(field) if field else None
        if kind is None:
            return None
        tag = kind.told_apart_by
        which = values.get(f"{prefix}{tag}", "") if tag else ""
        if tag and which and which not in kind.members:
            return None
        members = kind.chosen({tag: which} if tag else {})
    return next((each.model_fields[last] for each in members if last in each.model_fields), None)


def _default(field: FieldInfo) -> Any:
    default = field.get_default(call_default_factory=True, validated_data={})
    return None if default is PydanticUndefined or isinstance(default, BaseModel) else default


def _meaning(meaning: str, field: FieldInfo | None) -> str:
    bounds = list(dict.fromkeys(_bounds(field))) if field else []
    return ", ".join([meaning, *bounds])


def _bounds(field: FieldInfo) -> Iterator[str]:
    """Bounds of a field, or of the numbers in it."""
    for mark in (*field.metadata, *_marks(field.annotation)):
        match mark:
            case Ge(ge=bound):
                yield f"≥ {bound:g}"
            case Gt(gt=bound):
                yield f"> {bound:g}"
            case Le(le=bound):
                yield f"≤ {bound:g}"
            case Lt(lt=bound):
                yield f"< {bound:g}"


def _marks(annotation: Any) -> Iterator[Any]:
    for inside in (*get_args(annotation), *getattr(annotation, "__metadata__", ())):
        yield from inside.metadata if isinstance(inside, FieldInfo) else _marks(inside)


def _literals(annotation: Any) -> tuple[str, ...]:
    if get_origin(annotation) is Literal:
        return tuple(each for each in get_args(annotation) if isinstance(each, str))
    return ()
