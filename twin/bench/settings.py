"""What is set at a bench: the scenario that the next reset begins with, whatever mode it is in now."""

from __future__ import annotations

from typing import Any

from spheretwin.models.base.errors import InputError
from spheretwin.twin.scenario.changing import changed
from spheretwin.twin.scenario.hardware import fields_of_set
from spheretwin.twin.scenario.reading import override, validated
from spheretwin.twin.scenario.sections import Scenario

MODES_OWN = ("trajectory.approach", "manual")
"""Fields that modes set."""


def with_field(settings: Scenario, name: str, value: Any) -> Scenario:
    """Settings with another value of one field, checked as a whole.

    A named set of hardware gives its fields their values, as it does in a file that does not say them; those
    of the set before get their defaults.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range, or one that a mode sets.
    """
    if any(name == own or name.startswith(f"{own}.") for own in MODES_OWN):
        raise InputError(f"bench: expected a mode instead of {name}, as manual or hold")
    if name == "trajectory" and isinstance(value, dict) and value.get("approach") is not None:
        raise InputError("bench: expected a trajectory without approach, which the bench makes")
    after = changed(settings, name, value)
    return after if name != "hardware" else _with_hardware(settings, after.hardware)


def _with_hardware(settings: Scenario, hardware: str) -> Scenario:
    fields = settings.model_dump(mode="json")
    fields["hardware"] = hardware
    untouched = Scenario(trajectory=settings.trajectory).model_dump(mode="json")
    knows_truth = settings.nominal.equals_truth
    plain = {dotted: _value(untouched, dotted) for dotted in fields_of_set(settings.hardware, knows_truth)}
    for dotted, value in (plain | fields_of_set(hardware, knows_truth)).items():
        if dotted == "estimator.kind":  # another member of a family has other fields
            fields["estimator"] = {}
        override(fields, dotted, value)
    return validated(fields, settings.name)


def _value(fields: Any, dotted: str) -> Any:
    for part in dotted.split("."):
        fields = fields[part]
    return fields
