"""Manual currents: each group is commanded a given current, and the law is not called.

Sensors, estimator, fault detector, watchdog and the estimate of the applied torque stay active. The law
starts again from its initial state when it resumes control.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.models.base.compiled import allocation_free

Array = NDArray[np.float64]

# Far beyond the rating of any coil.
LARGEST_A = 1e3

Current = Annotated[float, Field(ge=-LARGEST_A, le=LARGEST_A)]


class ManualSection(BaseModel):
    """Manual currents; the law controls the actuator unless they are given."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    currents_A: tuple[Current, ...] | None = Field(
        None,
        description="current commanded to each group instead of that of the law, A; limited to"
        " nominal.current_limit_A",
    )

    @property
    def on(self) -> bool:
        """True if currents are given."""
        return self.currents_A is not None


class Manual(NamedTuple):
    """Manual currents of a run, for compiled code."""

    on: bool
    currents_A: Array  # (n,)


def manual(section: ManualSection, groups: int) -> Manual:
    """Return the manual currents of a section whose length has been checked."""
    return Manual(section.on, np.array(section.currents_A or np.zeros(groups), dtype=np.float64))


@allocation_free
def command_manual_currents(manual: Manual, limit_A: float, command: Array) -> float:
    """Write the currents (n,), A, each limited; return the least share of a current that the limit leaves."""
    share = 1.0
    for j in range(command.shape[0]):
        desired = manual.currents_A[j]
        command[j] = min(max(desired, -limit_A), limit_A)
        if command[j] != desired:
            share = min(share, limit_A / abs(desired))
    return share
