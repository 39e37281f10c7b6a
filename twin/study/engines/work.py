"""What every engine does with a row, wherever it runs."""

from __future__ import annotations

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.twin.study import agreement
from spheretwin.twin.study.grid import Row
from spheretwin.twin.study.row import Result, Rows


class Work:
    """Runs a row; some of them on both plants.

    Attributes
    ----------
    rows : Rows
    faults : list of SpheretwinError
        Why rows have no result: no fault of theirs.
    checked : list of int
        Rows that were run on both plants.
    """

    def __init__(self, rows: Rows) -> None:
        self.rows = rows
        self.faults: list[SpheretwinError] = []
        self.checked: list[int] = []

    def __call__(self, row: Row) -> Result | None:
        """Result of a row; None where there is a fault."""
        try:
            result = self.rows.carried_out(row)
            if result.error is None and self.rows.chooses_plant and agreement.is_checked(row):
                agreement.check(self.rows, row)
                self.checked.append(row.number)
        except SpheretwinError as error:
            self.faults.append(error)
            return None
        return result
