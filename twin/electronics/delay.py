"""Computation delay between a sample and the command that is computed from it."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.state import push_all

# Clock times are decimal fractions: a delay is a multiple of a step only up to rounding.
WHOLE = 1e-9

# Bounds the memory for a mistyped delay: each control period of delay stores one more command.
MOST_PERIODS = 1000


class DelaySection(BaseModel):
    """Parameters of the delay of commands."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    delay_s: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0,
        description="from sample to output, s; whole physics steps"
        " (prototype: assumed, one control period of 1 ms)",
    )


class Delay(NamedTuple):
    """Delayed commands."""

    history: NDArray[np.float64]  # (commands, n) A, newest first
    steps: int  # of physics, from sample to output
    substeps: int  # physics steps in a control period

    def state_arrays(self) -> tuple[NDArray[np.float64], ...]:
        """Return the arrays with the state."""
        return (self.history,)


def delay(section: DelaySection, step_s: float, substeps: int, groups: int) -> Delay:
    """Return a delay; the output before the first command is 0 A.

    Parameters
    ----------
    section : DelaySection
    step_s : float, s
        Physics step.
    substeps : int
        Physics steps in a control period.
    groups : int
        Length of a command.

    Raises
    ------
    ValueError
        The delay is not a whole number of physics steps, or longer than 1000 control periods.
    """
    ratio = section.delay_s / step_s
    steps = round(ratio)
    if abs(ratio - steps) > WHOLE * ratio or steps > MOST_PERIODS * substeps:
        raise ValueError(
            f"expected drive.delay_s a whole multiple of plant.step_s, at most {MOST_PERIODS} control"
            f" periods, received {section.delay_s!r} and {step_s!r} s"
        )
    commands = -(-steps // substeps) + 1
    return Delay(np.zeros((commands, groups)), steps, substeps)


@inlined
def latch(delay: Delay, command: NDArray[np.float64]) -> None:
    """Store the command (n,), A, that was computed from the sample of this control tick."""
    push_all(delay.history, command)


@inlined
def due(delay: Delay, substep: int, out: NDArray[np.float64]) -> None:
    """Write the active command at a physics step of the period.

    The command of k periods ago is active from step ``steps - k substeps`` of this period on, until the next
    command is active: it is the latest with ``k substeps + substep >= steps``.

    Parameters
    ----------
    delay : Delay
        After `latch` of this control tick.
    substep : int
        From 0 to the number of physics steps of a period minus 1.
    out : (n,) array, A
        Result.
    """
    missing = delay.steps - substep
    ago = (missing + delay.substeps - 1) // delay.substeps if missing > 0 else 0
    for j in range(out.shape[0]):
        out[j] = delay.history[ago, j]
