"""A scenario whose controller may also be a law from a file of its user's."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Any, get_args

from pydantic import Field, SerializeAsAny

from spheretwin.control.laws.registry import AnyLaw
from spheretwin.control.own_law import parameters_of
from spheretwin.control.parts.parameters import LawParameters
from spheretwin.models.base.user_code import is_reference
from spheretwin.twin.scenario.sections import Scenario


def scenario_with(law: Any) -> type[Scenario]:
    """Class of scenarios with a law: the common one, or one whose laws are those shipped and a user's.

    Raises
    ------
    InputError
        The law is one in a file, and cannot be had.
    """
    return _extended(parameters_of(law)) if is_reference(law) else Scenario


def kind_of_scenario(scenario: Scenario) -> type[Scenario]:
    """Class of the scenarios with the law of a scenario, as it was read."""
    controller = scenario.controller
    if is_reference(controller.law) and isinstance(controller, LawParameters):
        return _extended(type(controller))
    return Scenario


@lru_cache(maxsize=32)
def _extended(own: type[LawParameters]) -> type[Scenario]:
    laws: Any = Annotated[get_args(AnyLaw)[0] | own, Field(discriminator="law")]

    class Extended(Scenario):
        controller: SerializeAsAny[laws] = Scenario.model_fields["controller"].default

        def __reduce__(self) -> tuple[Any, ...]:
            """A class made for a file is made anew where it is unpickled; what the scenario holds stays."""
            return _blank, (own.model_fields["law"].default,), self.__getstate__()

    Extended.__name__ = Extended.__qualname__ = Scenario.__name__
    return Extended


def _blank(law: str) -> Scenario:
    kind = scenario_with(law)
    return kind.__new__(kind)
