"""A recorded run played back: its rows are shown, and nothing is simulated."""

from __future__ import annotations

from pathlib import Path

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import common_signals
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.bench.history import History
from spheretwin.twin.review import run as reviewed


class Player:
    """One recorded run, at one of its rows.

    Parameters
    ----------
    path : Path
        Telemetry or recording.

    Attributes
    ----------
    name, law, shape, allocation : str
        Of the run, as its file says.
    table : Table
    period_s : float
    place : int
        Rows that have been shown.
    history : History

    Raises
    ------
    InputError
        The file is none of a run, or holds no rows.
    """

    def __init__(self, path: Path) -> None:
        run = reviewed.read(path)
        self.path, self.table = path, run.table
        groups = run.table["current_A"].shape[1] if len(run.table) else 0
        known = {signal.name for signal in run.table.signals}
        if not {signal.name for signal in common_signals(max(groups, 1))} <= known:
            raise InputError(f"bench: expected rows of a whole run in {path}, received {len(run.table)} rows")
        scenario = run.record.scenario
        self.period_s = run.period_s
        self.name, self.law = str(scenario["name"]), str(scenario["controller"]["law"])
        self.shape, self.allocation = str(scenario["trajectory"]["shape"]), str(scenario["allocation"])
        self.current_limit_A = float(scenario["nominal"]["current_limit_A"])
        self.place = 1
        self.history = History(groups, self.period_s)
        self.history.write(0, self.row)

    @property
    def over(self) -> bool:
        """Whether the last row is shown."""
        return self.place >= len(self.table)

    @property
    def row(self) -> Table:
        """The row that is shown."""
        return self.table.rows(self.place - 1, self.place)

    def advance(self, ticks: int) -> int:
        """Show some rows more; returns how many there were."""
        first = self.place
        self.place = min(first + ticks, len(self.table))
        self.history.write(first, self.table.rows(first, self.place))
        return self.place - first
