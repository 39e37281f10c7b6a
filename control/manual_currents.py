"""Currents by hand: each group is asked for a stated current, and the law for nothing.

What looks after the actuator goes on: sensors, estimator, detector, watchdog, and what the controller
believes of the currents. A law that takes over again begins anew: it knows nothing of the time between.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.models.base.compiled import allocation_free

Array = NDArray[np.float64]

# Far beyond what any coil bears.
LARGEST_A = 1e3

Current = Annotated[float, Field(ge=-LARGEST_A, le=LARGEST_A)]


class ManualSection(BaseModel):
    """Currents by hand; the law has the actuator unless some are given."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    currents_A: tuple[Current, ...] | None = Field(
        None,
        description="current that each group is asked for instead of what the law wants, A; cut at"
        " nominal.current_limit_A",
    )

    @property
    def on(self) -> bool:
        """Whether there are any."""
        return self.currents_A is not None


class Manual(NamedTuple):
    """Currents by hand in a run, for compiled code."""

    on: bool
    currents_A: Array  # (n,)


def manual(section: ManualSection, groups: int) -> Manual:
    """Currents of a section whose length has been checked."""
    return Manual(section.on, np.array(section.currents_A or np.zeros(groups), dtype=np.float64))


@allocation_free
def command_manual_currents(manual: Manual, limit_A: float, command: Array) -> float:
    """Write the currents (n,), A, each cut at a limit; returns the least share that the cut left of one."""
    share = 1.0
    for j in range(command.shape[0]):
        desired = manual.currents_A[j]
        command[j] = min(max(desired, -limit_A), limit_A)
        if command[j] != desired:
            share = min(share, limit_A / abs(desired))
    return share
