"""Scenarios: all inputs of a run, from TOML and flags, validated together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from spheretwin.control.laws import LAWS
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import is_reference
from spheretwin.scenario.changes import check_events, complete_fields
from spheretwin.scenario.reading import validated
from spheretwin.scenario.sections import Scenario
from spheretwin.trajectories import SHAPES


def load(source: str, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Read a scenario and override some of its fields.

    Parameters
    ----------
    source : str
        A shipped name, or the path of a TOML file; ``~`` is the user's home. Paths in the file are relative
        to the folder of the file.
    overrides : mapping, optional
        Values by dotted name, such as ``{"controller.law": "pd"}``; paths are relative to the working
        folder.

    Raises
    ------
    InputError
        The scenario does not exist, or a field is unknown, of the wrong type or out of range.
    """
    return check_events(validated(complete_fields(source, overrides or {}), source), source)


def from_record(fields: Mapping[str, Any], source: str) -> Scenario:
    """Return the scenario of the record of a run, its fields by section.

    Raises
    ------
    InputError
        The law or the trajectory of the run was a Python object that is not in a file, or the version that
        recorded the run had other fields.
    """
    law = fields.get("controller", {}).get("law")
    if law not in LAWS and not is_reference(law):
        raise InputError(
            f"scenario {source}: expected a run under {', '.join(LAWS)}, received one under {law},"
            " a law that its file does not contain"
        )
    shape = fields.get("trajectory", {}).get("shape")
    if shape not in SHAPES:
        raise InputError(
            f"scenario {source}: expected a run along one of {', '.join(SHAPES)}, received one along {shape},"
            " a trajectory that its file does not contain"
        )
    return validated(_with_truth(fields), source)


def _with_truth(fields: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the fields of a record; in old records without a data sheet the controller knew the truth."""
    nominal = fields.get("nominal", {})
    return fields if "equals_truth" in nominal else {**fields, "nominal": {**nominal, "equals_truth": True}}
