"""One name for a physics step, whichever engine takes it.

Compiled code needs to know its rotor when it is compiled: the loop is compiled once for each kind, from
the same source, and holds a direct call to that kind's step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.extending import overload

from spheretwin.twin.plant.registry import ENGINES

_STEPS: dict[type, Callable[[Any], None]] = {row.stepped: row.step for row in ENGINES.values()}


def step(rotor: Any) -> None:
    """One physics step of what `Rotor.start` returned, from compiled code or from Python."""
    _STEPS[type(rotor)](rotor)


@overload(step)
def _compiled_step(rotor: Any) -> Callable[[Any], None] | None:
    """Tell numba, which knows a named tuple by its class, what `step` does."""
    kind: Any = getattr(rotor, "instance_class", None)
    if kind not in _STEPS:
        return None
    step_of_kind = _STEPS[kind]

    def call(rotor: Any) -> None:
        step_of_kind(rotor)

    return call
