"""A law from a file of its user's, named ``FILE.py:NAME``; its parameters are fields like any other's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from pydantic import Field, create_model

from spheretwin.control.law import Known, Law
from spheretwin.control.parts.parameters import LawParameters, named
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import load_named
from spheretwin.models.base.wording import shown


def parameters_of(reference: str) -> type[LawParameters]:
    """Parameters of a user's law.

    Parameters
    ----------
    reference : str
        ``FILE.py:NAME``. The name is that of a subclass of `LawParameters`; or of a `Law`, or of a step
        function (plain, or compiled by numba) without memory, which get one field `parameters`: the
        numbers that are handed to every call.

    Raises
    ------
    InputError
        The file cannot be run, or the name is none of a law.
    """
    return _named(reference, load_named(reference, "law"))


@lru_cache(maxsize=32)
def _named(reference: str, found: Any) -> type[LawParameters]:
    """One class for one law: sections of two scenarios can only be equal where their classes are."""
    if isinstance(found, type) and issubclass(found, LawParameters):
        base = found
    elif isinstance(found, Law):
        base = _of_law(found)
    elif callable(found) and not isinstance(found, type):
        base = _of_law(_without_memory(reference, found))
    else:
        raise InputError(
            f"law {reference}: expected a subclass of LawParameters, a Law, or a function,"
            f" received {shown(found)}"
        )
    fields: Any = {"law": (Literal[reference], named(reference))}
    return create_model(base.__name__, __base__=base, __module__=base.__module__, **fields)


def _without_memory(reference: str, step: Callable[..., Any]) -> Law:
    return Law(reference.rpartition(":")[2], step, np.zeros(0), np.zeros(0))


def _of_law(law: Law) -> type[LawParameters]:
    numbers = tuple(law.parameters.tolist())

    class OfLaw(LawParameters):
        parameters: tuple[float, ...] = Field(numbers, description=f"numbers handed to {law.name}")

        def build(self, known: Known) -> Law:
            return replace(law, parameters=np.array(self.parameters))

    OfLaw.__name__ = law.name
    return OfLaw
