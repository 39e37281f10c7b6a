"""A law from a file of its user's, named ``FILE.py:NAME``; its parameters are fields like any other's."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from inspect import isabstract, unwrap
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
from pydantic import Field, create_model

from spheretwin.control.law import Law, NominalModel
from spheretwin.control.law_components.parameters import COMPENSATORS, LawParameters, named
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.user_code import load_with_digest


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
    found, digest = load_with_digest(reference, "law")
    key = reference, id(found)
    if key not in _CLASSES:
        _CLASSES[key] = found, _class_of(reference, found, digest)
    return _CLASSES[key][1]


# One class for one law: sections of two scenarios can only be equal where their classes are. What a class
# was made of is held, so that nothing else gets its identity.
_CLASSES: dict[tuple[str, int], tuple[Any, type[LawParameters]]] = {}


def _class_of(reference: str, found: Any, digest: str) -> type[LawParameters]:
    if isinstance(found, type) and issubclass(found, LawParameters):
        if isabstract(found):
            raise InputError(f"law {reference}: expected a class with build(known), received one without")
        common, own = LawParameters.model_fields, found.model_fields
        if taken := [name for name in COMPENSATORS if own[name].annotation != common[name].annotation]:
            raise InputError(f"law {reference}: expected no parameter named {taken[0]}, received one")
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
    made = create_model(base.__name__, __base__=(_FromFile, base), __module__=base.__module__, **fields)
    kind = cast("type[LawParameters]", made)
    kind.source = digest
    return kind


def reference_of(law: Law | None) -> str | None:
    """Reference ``FILE.py:NAME`` of a law that stands at the top level of an imported module.

    None without a law, or for one that no file holds: made inside a function, typed at a prompt, or defined
    in the script that runs, which would run again when it is loaded.
    """
    if law is None:
        return None
    function = unwrap(getattr(law.step, "py_func", law.step))
    module = sys.modules.get(getattr(function, "__module__", ""))
    path = getattr(module, "__file__", None)
    if module is None or path is None or module.__name__ == "__main__":
        return None
    names = (name for name, value in vars(module).items() if value is law)
    return next((f"{Path(path).resolve()}:{name}" for name in names), None)


class _FromFile(LawParameters):
    """Parameters of a class that is made for a file, and made anew where they are unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Class by its file, then what the parameters hold."""
        return _blank, (self.law,), self.__getstate__()


def _blank(reference: str) -> LawParameters:
    kind = parameters_of(reference)
    return kind.__new__(kind)


def _without_memory(reference: str, step: Callable[..., Any]) -> Law:
    return Law(reference.rpartition(":")[2], step, np.zeros(0), np.zeros(0))


def _of_law(law: Law) -> type[LawParameters]:
    numbers = tuple(law.parameters.tolist())

    class OfLaw(LawParameters):
        parameters: tuple[float, ...] = Field(numbers, description=f"numbers handed to {law.name}")

        def build(self, known: NominalModel) -> Law:
            return replace(law, parameters=np.array(self.parameters))

    OfLaw.__name__ = law.name
    return OfLaw
