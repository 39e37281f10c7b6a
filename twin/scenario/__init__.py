"""Scenarios: everything one run depends on, from TOML and flags, checked as one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from spheretwin.control.laws import LAWS
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import is_reference
from spheretwin.scenario.changes import check_events, fields_with
from spheretwin.scenario.reading import beside, override, validated
from spheretwin.scenario.sections import Scenario, hardware_defaults
from spheretwin.trajectories import SHAPES


def load(source: str, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Read a scenario and override some of its fields.

    Parameters
    ----------
    source : str
        A shipped name, or the path of a TOML file; ``~`` is the user's home. Paths in the file are taken
        from where the file is.
    overrides : mapping, optional
        Values by dotted name, such as ``{"controller.law": "pd"}``; paths are taken from the working folder.

    Raises
    ------
    InputError
        No such scenario, or a field that is unknown, of the wrong type or out of range.
    """
    fields = fields_with(source, overrides or {})
    hardware = fields.get("hardware")
    for dotted, value in hardware_defaults(fields, hardware if isinstance(hardware, str) else None).items():
        override(fields, dotted, value)
    try:
        taken = beside("", fields)
    except RecursionError:
        raise InputError(f"scenario {source}: expected values of less depth") from None
    return check_events(validated(taken, source), source)


def from_record(fields: Mapping[str, Any], source: str) -> Scenario:
    """Scenario from what a run said of itself, the fields by section.

    Raises
    ------
    InputError
        It was run under a law, or along a trajectory, of its user's that is in no file, or by a version with
        other fields.
    """
    law = fields.get("controller", {}).get("law")
    if law not in LAWS and not is_reference(law):
        raise InputError(
            f"scenario {source}: expected a run under {', '.join(LAWS)}, received one under {law},"
            " a law that its file does not hold"
        )
    shape = fields.get("trajectory", {}).get("shape")
    if shape not in SHAPES:
        raise InputError(
            f"scenario {source}: expected a run along one of {', '.join(SHAPES)}, received one along {shape},"
            " a trajectory that its file does not hold"
        )
    return validated(_with_truth(fields), source)


def _with_truth(fields: Mapping[str, Any]) -> Mapping[str, Any]:
    """Fields of a record. Before the controller had a data sheet, it knew drive and sensors as they were."""
    nominal = fields.get("nominal", {})
    return fields if "equals_truth" in nominal else {**fields, "nominal": {**nominal, "equals_truth": True}}
