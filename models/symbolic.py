"""Equations of the model on symbols: its compiled functions as plain Python, for code and derivatives.

A function of `kinematics`, `lagrangian` or `joint_chain` only needs sums, products, and the cosine and the
sine of each angle. So it computes with anything that has these: expressions of C or of CasADi.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

from spheretwin.models import joint_chain, kinematics, lagrangian
from spheretwin.models.base.compiled import uncompiled
from spheretwin.models.kinematics import Turns

_MODULES = {module.__name__ for module in (kinematics, lagrangian, joint_chain)}


def on_symbols(function: Callable[..., Any], **replaced: Callable[..., Any]) -> Callable[..., Any]:
    """Return a compiled function as plain Python, with the functions that it calls.

    Parameters
    ----------
    function : callable
        Compiled function of the model.
    **replaced : callable
        Functions for its names, such as `turns_by` of a library for ``turns``.
    """
    plain: Any = uncompiled(function)
    scope = dict(plain.__globals__)
    for name in plain.__code__.co_names:
        called = uncompiled(scope.get(name, len))
        if name in replaced:
            scope[name] = replaced[name]
        elif isinstance(called, FunctionType) and called.__module__ in _MODULES:
            scope[name] = on_symbols(called, **replaced)
    return FunctionType(plain.__code__, scope, plain.__name__)


def turns_by(cosine: Callable[[Any], Any], sine: Callable[[Any], Any]) -> Callable[[Any], Turns]:
    """Return the function ``turns`` of the kinematics for symbols with this cosine and sine."""

    def turns(q: Any) -> Turns:
        return Turns(*(function(q[i]) for i in range(3) for function in (cosine, sine)))

    return turns
