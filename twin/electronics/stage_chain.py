"""Compiled chain of stages: one function that passes values through all of them, in their order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from spheretwin.models.base.compiled import part_of_its_caller


@part_of_its_caller
def pass_nothing(stages: Any, values: Any, draws: Any) -> None:
    """Leave the values as they are."""


def chained(functions: Sequence[Any], place: int = 0) -> Any:
    """Return the compiled function ``f(stages, values, draws)`` that calls those of all stages.

    Parameters
    ----------
    functions : sequence of compiled functions
        ``f(stage, values, draws)`` each, in the order of `stages`. These are named tuples whose field
        ``on`` says whether a stage does anything; one that is off costs a branch.
    place : int
        Of the first stage that is called.
    """
    if place == len(functions):
        return pass_nothing
    function, others = functions[place], chained(functions, place + 1)

    @part_of_its_caller
    def pass_and_go_on(stages: Any, values: Any, draws: Any) -> None:
        stage = stages[place]
        if stage.on:
            function(stage, values, draws)
        others(stages, values, draws)

    return pass_and_go_on
