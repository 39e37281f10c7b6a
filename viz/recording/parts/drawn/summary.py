"""The run in one line: what it is, how it stands, how large its errors were."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.allocation import rank_lost, saturated
from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.models.telemetry.status import Level, Status
from spheretwin.models.telemetry.table import Table

# Axes, what was asked and what the controller believes have the same colours in every plot.
KEY = "α red, β green, γ blue; white what was asked, amber what the controller takes for true"


class Summary:
    """Keeps what the line needs.

    Parameters
    ----------
    facts : RunFacts
        What is known from the start.

    Attributes
    ----------
    last_s : float
        Time of the last row.
    """

    def __init__(self, facts: RunFacts) -> None:
        self._facts = facts
        self.last_s = 0.0
        self._ticks = 0
        self._saturated = self._rank_lost = 0
        self._largest_deg = 0.0
        self._squares = 0.0

    def add(self, rows: Table, error_deg: NDArray[np.float64]) -> None:
        """Add the rows of a chunk, with the error angle of each."""
        self.last_s = float(rows["t_s"][-1])
        self._ticks += len(rows)
        self._saturated += int(np.count_nonzero(saturated(rows)))
        self._rank_lost += int(np.count_nonzero(rank_lost(rows)))
        told = error_deg[np.isfinite(error_deg)]  # the last rows of a run that diverged may hold no numbers
        self._largest_deg = max(self._largest_deg, float(np.max(told, initial=0.0)))
        self._squares += float(np.sum(told**2))

    def running(self) -> str:
        """The line while the run goes on."""
        return _told(f"{self._what()} — running")

    def ended(self, status: Status) -> str:
        """The line once it has ended."""
        how = "completed" if status.level is Level.INFO else f"**{status.replace('_', ' ')}**"
        at = "" if status == Status.COMPLETED else f" at {self.last_s:.3g} s of {self._facts.duration_s:g} s"
        if not self._ticks:
            return _told(f"{self._what()} — {how}")
        lost = f"; rank lost {_percent(self._rank_lost / self._ticks)} of the time" if self._rank_lost else ""
        rms_deg = np.sqrt(self._squares / self._ticks)
        return _told(
            f"{self._what()} — {how}{at}; error largest **{self._largest_deg:.3g}°**, RMS **{rms_deg:.3g}°**;"
            f" saturated {_percent(self._saturated / self._ticks)} of the time{lost}"
        )

    def _what(self) -> str:
        facts = self._facts
        told = [f"**{facts.name}** under **{facts.law}**"]
        told += [
            f"{symbol} = {value:g}"
            for symbol, section, field in (
                ("m", "plant", "modelling_error"),
                ("L", "disturbance", "load"),
            )
            if isinstance(value := self._field(section, field), int | float)
        ]
        if facts.payload_kg:
            told.append(f"payload {facts.payload_kg:g} kg")
        if hardware := self._field("run", "hardware"):
            told.append(f"{hardware} hardware")
        if faults := self._field("run", "fault"):
            told.append(f"{len(faults)} fault{'s' * (len(faults) > 1)} planned")
        return " · ".join(told)

    def _field(self, section: str, field: str) -> Any:
        return self._facts.sections.get(section, {}).get(field)


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if 0 < share < 0.1 else f"{100 * share:.0f} %"


def _told(line: str) -> str:
    """The line, and below it what the colours mean."""
    return f"{line}\n\n{KEY}"
