"""Scenarios: all inputs of a run, from TOML and flags, validated together."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spheretwin.control.laws import LAWS
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import is_reference
from spheretwin.scenario.changes import check_events, complete_fields, with_change
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


def scenario_of(given: Scenario | str | Path, changes: Mapping[str, Any] | None = None) -> Scenario:
    """Return a scenario with some changes: itself, that of a shipped name or that of a file.

    Raises
    ------
    InputError
        As `load`.
    """
    if not isinstance(given, Scenario):
        return load(os.fspath(given), changes)
    for dotted, value in (changes or {}).items():
        given = with_change(given, dotted, value)
    return given


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
