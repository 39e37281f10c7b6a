"""Relative axes of a study: factors of a field's own value become values before the rows are made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from spheretwin.config.active_config import fill_defaults
from spheretwin.models.base.errors import InputError, shown
from spheretwin.scenario.fields import explain, flat
from spheretwin.scenario.files import files_of
from spheretwin.study.axes import Axis
from spheretwin.study.row import Rows
from spheretwin.study.study import Study
from spheretwin.study.template import is_number


def absolute(study: Study) -> Study:
    """Return a study whose relative axes have values: their factors times the field's own value.

    A field's own value is that of the base scenario with the study's fields and all defaults filled in.

    Parameters
    ----------
    study : Study

    Raises
    ------
    InputError
        A field has no number or the number 0, is a gain while each [[law]] has its own, or a factor leads
        out of the range of an axis.
    """
    if not any(axis.relative for axis in study.axis):
        return study
    base = Rows(study.model_copy(update={"axis": (), "samples": None})).base
    known = flat(fill_defaults(base, files_of(base), None, None).model_dump(mode="json"))
    axes = tuple(_scaled(study, axis, known) if axis.relative else axis for axis in study.axis)
    return study.model_copy(update={"axis": axes})


def _scaled(study: Study, axis: Axis, known: Mapping[str, Any]) -> Axis:
    own, place = number(known, axis.field), f"study {study.name}: axis over {axis.field}"
    if study.law and axis.field.startswith("controller."):
        raise InputError(
            f"{place}: expected values, because each [[law]] has its own gains, received relative"
        )
    if not own:
        raise InputError(
            f"{place}: expected a field with a number other than 0 for relative, received {shown(own)}"
        )
    try:
        return axis.scaled(own)
    except ValidationError as error:
        raise InputError(f"{place}, relative to {own:g}: {explain(error, type(axis))}") from None


def number(known: Mapping[str, Any], name: str) -> float | None:
    """Return the number of a field, or of an entry of a list; None if there is none.

    Parameters
    ----------
    known : mapping
        Values of all fields by dotted name.
    name : str
        Dotted name, with an index behind it for an entry.
    """
    whole, _, place = name.rpartition(".")
    listed = known.get(whole)
    is_entry = isinstance(listed, list) and place.isdecimal() and int(place) < len(listed)
    value: Any = listed[int(place)] if is_entry and isinstance(listed, list) else known.get(name)
    return float(value) if is_number(value) else None
