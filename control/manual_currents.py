"""Manual currents: each group is commanded a given current, and the law is not called.

Sensors, estimator, fault detector, watchdog and the estimate of the applied torque stay active. The law
starts again from its initial state when it resumes control.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.record import Record, field
from spheretwin.models.telemetry.csv_series import TIME, TimeSeries, reached, read

# Far beyond the rating of any coil.
LARGEST_A = 1e3

Current = Annotated[float, Field(ge=-LARGEST_A, le=LARGEST_A)]


class ManualSection(BaseModel):
    """Manual currents; the law controls the actuator unless they are given.

    A file is read when the section is created; later changes of the file have no effect.

    Raises
    ------
    InputError
        The file is not a series of currents.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    currents_A: tuple[Current, ...] | None = Field(
        None,
        description="current commanded to each group instead of that of the law, A; limited to"
        " nominal.current_limit_A",
    )
    file: Annotated[str, Field(min_length=1)] | None = Field(
        None,
        description=f"CSV of these currents over time, with the columns {TIME}, current_00_A, current_01_A"
        " and so on; the first row applies before, the last after its time",
        json_schema_extra={"path": True},
    )
    between: Literal["held", "linear"] = Field(
        "held", description="currents between two rows: the earlier row held, or linear interpolation"
    )

    _series: TimeSeries | None = PrivateAttr(None)

    @property
    def on(self) -> bool:
        """True if currents are given."""
        return self.series is not None

    @property
    def series(self) -> TimeSeries | None:
        """Currents over time; None if the law controls the actuator."""
        return self._series

    @model_validator(mode="after")
    def _read(self) -> ManualSection:
        if self.file is not None:
            if self.currents_A is not None:
                raise ValueError("expected either currents_A or file, received both")
            self._series = read("manual currents", Path(self.file), current_columns, LARGEST_A)
        elif self.currents_A is not None:
            self._series = TimeSeries(np.zeros(1), np.array([self.currents_A]))
        return self


def current_columns(header: Sequence[str]) -> list[str]:
    """Return the columns of as many groups as a header has columns of currents; of one if it has none."""
    count = sum(name.startswith("current_") for name in header)
    return [f"current_{group:02}_A" for group in range(max(count, 1))]


class Manual(Record):
    """Manual currents of a run."""

    on: bool = field("whether they replace the currents of the law")
    current_A: Array = field("currents of this tick, not limited", "A", "groups")


def sample_currents(section: ManualSection, t: Array) -> Array:
    """Return the manual currents (k, n), A, at some times (k,), s; (k, 0) if there are none."""
    series = section.series
    if series is None:
        return np.empty((len(t), 0))
    t_s, values = reached(series.t_s), series.values
    after = np.searchsorted(t_s, t, side="right")
    row, after = np.maximum(after - 1, 0), np.minimum(after, len(t_s) - 1)
    if section.between == "held":
        return values[row]
    duration_s = np.where(after > row, t_s[after] - t_s[row], np.inf)
    return values[row] + ((t - t_s[row]) / duration_s)[:, None] * (values[after] - values[row])


@allocation_free
def command_manual_currents(manual: Manual, limit_A: float, command: Array) -> float:
    """Write the currents (n,), A, each limited; return the least share of a current that the limit leaves."""
    share = 1.0
    for j in range(command.shape[0]):
        desired = manual.current_A[j]
        command[j] = min(max(desired, -limit_A), limit_A)
        if command[j] != desired:
            share = min(share, limit_A / abs(desired))
    return share
