"""Law from a user's file, named ``FILE.py:NAME``; its parameters are fields like those of shipped laws."""

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
from spheretwin.models.base.user_code import load_again, load_with_digest


def parameters_of(reference: str) -> type[LawParameters]:
    """Return the parameter class of a user's law.

    Parameters
    ----------
    reference : str
        ``FILE.py:NAME``. NAME is a subclass of `LawParameters`, or a `Law`, or a step function (plain, or
        compiled by numba) without memory. The last two get one field `parameters`: the numbers passed to
        every call.

    Raises
    ------
    InputError
        The file cannot be run, or the name is not that of a law.
    """
    law_object, digest = load_with_digest(reference, "law")
    key = reference, id(law_object)
    if key not in _CLASSES:
        _CLASSES[key] = law_object, _parameter_class(reference, law_object, digest)
    return _CLASSES[key][1]


# One class per law: sections of two scenarios are equal only if their classes are. The object of each class
# is stored, so that no other object gets its identity.
_CLASSES: dict[tuple[str, int], tuple[Any, type[LawParameters]]] = {}


def _parameter_class(reference: str, law_object: Any, digest: str) -> type[LawParameters]:
    base = _base_class(reference, law_object)
    fields: Any = {"law": (Literal[reference], named(reference))}
    model = create_model(base.__name__, __base__=(_FromFile, base), __module__=base.__module__, **fields)
    kind = cast("type[LawParameters]", model)
    kind.source = digest
    return kind


def _base_class(reference: str, law_object: Any) -> type[LawParameters]:
    """Return the parameter class that an object of a file is, or that builds it.

    Raises
    ------
    InputError
        The object is no law.
    """
    if isinstance(law_object, type) and issubclass(law_object, LawParameters):
        if isabstract(law_object):
            raise InputError(f"law {reference}: expected a class with build(known), received one without")
        common, own = LawParameters.model_fields, law_object.model_fields
        if taken_names := [name for name in COMPENSATORS if own[name].annotation != common[name].annotation]:
            raise InputError(f"law {reference}: expected no parameter named {taken_names[0]}, received one")
        return law_object
    if isinstance(law_object, Law):
        return _parameters_of_law(law_object)
    if callable(law_object) and not isinstance(law_object, type):
        return _parameters_of_law(_without_memory(reference, law_object))
    raise InputError(
        f"law {reference}: expected a subclass of LawParameters, a Law, or a function,"
        f" received {shown(law_object)}"
    )


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
    """Base of the parameter classes of user files; unpickling builds the class again from the file."""

    def build(self, known: NominalModel) -> Law:
        """Return the law; one in plain Python is of a new module: no run has the memory of another."""
        # Abstract here only: the class of the user, the next base, has it.
        law: Any = super().build(known)  # type: ignore[safe-super]
        if not isinstance(law, Law) or hasattr(law.step, "py_func"):
            return law
        fresh = _base_class(self.law, load_again(self.law))
        return fresh.model_construct(**dict(self)).build(known)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the reference to the file, then the values of the parameters."""
        return _blank, (self.law,), self.__getstate__()


def _blank(reference: str) -> LawParameters:
    kind = parameters_of(reference)
    return kind.__new__(kind)


def _without_memory(reference: str, step: Callable[..., Any]) -> Law:
    return Law(reference.rpartition(":")[2], step, np.zeros(0), np.zeros(0))


def _parameters_of_law(law: Law) -> type[LawParameters]:
    numbers = tuple(law.parameters.tolist())

    class FixedLaw(LawParameters):
        parameters: tuple[float, ...] = Field(numbers, description=f"numbers passed to {law.name}")

        def build(self, known: NominalModel) -> Law:
            return replace(law, parameters=np.array(self.parameters))

    FixedLaw.__name__ = law.name
    return FixedLaw
