"""A torque from a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, model_validator

from spheretwin.models.telemetry.series import TIME, Series, read
from spheretwin.twin.disturbances.term import LARGEST_Nm, Term

COLUMNS = ("alpha_Nm", "beta_Nm", "gamma_Nm")


class Table(Term):
    """Torques of a CSV file at their times; the first before, the last after them.

    The file is read when the term is made: what becomes of it later changes nothing.

    Raises
    ------
    InputError
        The file is no series of torques.
    """

    kind: Literal["table"] = Field("table", description="kind of disturbance")
    file: Annotated[str, Field(min_length=1)] = Field(
        description=f"CSV of the torques, with the columns {', '.join((TIME, *COLUMNS))}",
        json_schema_extra={"path": True},
    )
    between: Literal["linear", "held"] = Field(
        "linear", description="torque between two rows: on a straight line, or the earlier one"
    )

    _torques: Series = PrivateAttr()

    def sample(  # noqa: D102
        self, t: NDArray[np.float64], draws: Callable[[], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        if self.between == "held":
            return self._torques.held(t, self._torques.values[0])
        return self._torques.linear(t)

    @model_validator(mode="after")
    def _read(self) -> Table:
        self._torques = read("disturbance", Path(self.file), COLUMNS, LARGEST_Nm)
        return self
