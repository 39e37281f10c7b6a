"""Interface of the parts of the plant: physics with data, and as a rule a state, of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from pydantic import BaseModel

from spheretwin.electronics.stages import pass_nothing
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.record import Record, Rows


class PlantSetup(NamedTuple):
    """Conditions that a part is filled for."""

    scenario: Any
    """Resolved; or the columns of those of n rows."""
    actuator: Actuator
    rotor: Rows
    """Array of RotorData, one for each row, started."""
    drive: Rows
    """Array of DriveChain, one for each row."""


class PlantPart(NamedTuple):
    """Row of the list of the parts of the plant.

    The functions of a part are compiled ``f(part, plant, substep)`` with the record of the part, that of the
    plant, and the number of the physics step in the control period. They are called if the field `on` of the
    part is 1.
    """

    record: type[Record]
    """Data of the part, with a field `on`."""
    fill: Callable[[Rows, PlantSetup], None]
    """Fill records of the part, in which every number is 0."""
    section: type[BaseModel] | None = None
    """Parameters in the section `plant`, under the name of the part; None if they are fields of `plant`."""
    begin: Any = pass_nothing
    """At the start of a control period."""
    before: Any = pass_nothing
    """At the start of a physics step: may change the rates; in the order of the list."""
    load: Any = pass_nothing
    """Before the step of the rotor: may add to `plant.rotor.torque_q`, the torque on the hinges."""
    after: Any = pass_nothing
    """After the step of the rotor: may change pose and rates; in the reverse order."""
    end: Any = pass_nothing
    """At the end of a control period."""
