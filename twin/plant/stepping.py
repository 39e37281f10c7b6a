"""One name for a physics step, whichever plant is stepped.

Compiled code needs to know its plant when it is compiled: the loop is compiled once for each kind, from
the same source, and holds a direct call to that kind's step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.extending import overload

from spheretwin.twin.plant import engine, lagrangian
from spheretwin.twin.plant.engine import Engine
from spheretwin.twin.plant.lagrangian import Equations

Plant = Engine | Equations

_STEPS: dict[type, Callable[[Any], None]] = {Engine: engine.step, Equations: lagrangian.step}


def step(plant: Plant) -> None:
    """One physics step of a plant, from compiled code or from Python."""
    _STEPS[type(plant)](plant)


@overload(step)
def _compiled_step(plant: Any) -> Callable[[Any], None] | None:
    """Tell numba, which knows a named tuple by its class, what `step` does."""
    kind: Any = getattr(plant, "instance_class", None)
    if kind not in _STEPS:
        return None
    step_of_kind = _STEPS[kind]

    def call(plant: Any) -> None:
        step_of_kind(plant)

    return call
