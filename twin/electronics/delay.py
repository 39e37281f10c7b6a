"""Computation delay between a sample and the command that is computed from it."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.history import push_all
from spheretwin.models.base.record import Record, field

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


class Delay(Record):
    """Delayed commands."""

    history: Array = field("commands, newest first", "A", ("delays", "groups"), state=True)
    steps: int = field("physics steps from sample to output")
    substeps: int = field("physics steps in a control period")


def steps_of(section: DelaySection, step_s: float, substeps: int) -> Any:
    """Return the physics steps (of step_s) of a delay, whole numbers.

    Raises
    ------
    ValueError
        The delay is not a whole number of physics steps, or longer than 1000 control periods.
    """
    ratio = np.divide(section.delay_s, step_s)
    steps = np.rint(ratio).astype(int)
    wrong = (np.abs(ratio - steps) > WHOLE * ratio) | (steps > np.multiply(MOST_PERIODS, substeps))
    if wrong.any():
        columns = np.broadcast_arrays(section.delay_s, step_s)
        delay_s, received_s = (values[wrong].item(0) for values in columns)
        raise ValueError(
            f"expected drive.delay_s a whole multiple of plant.step_s, at most {MOST_PERIODS} control"
            f" periods, received {delay_s!r} and {received_s!r} s"
        )
    return steps


def stored_commands(steps: int, substeps: int) -> Any:
    """Return the commands that a delay of some physics steps stores."""
    return -(-steps // substeps) + 1


@inlined
def latch(delay: Delay, command: Array) -> None:
    """Store the command (n,), A, that was computed from the sample of this control tick."""
    push_all(delay.history, command)


@inlined
def due(delay: Delay, more_steps: int, substep: int, out: Array) -> None:
    """Write the active command at a physics step of the period.

    The command of k periods ago is active from step ``steps - k substeps`` of this period on, until the next
    command is active: it is the latest with ``k substeps + substep >= steps``.

    Parameters
    ----------
    delay : Delay
        After `latch` of this control tick.
    more_steps : int
        Additional delay.
    substep : int
        From 0 to the number of physics steps of a period minus 1.
    out : (n,) array, A
        Result.
    """
    missing = delay.steps + more_steps - substep
    ago = (missing + delay.substeps - 1) // delay.substeps if missing > 0 else 0
    for j in range(out.shape[0]):
        out[j] = delay.history[ago, j]
