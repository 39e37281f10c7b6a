"""Headline of a recording: how the run ended, its errors, its faults, and what was run."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.fault_log import FAULT, FaultLog
from spheretwin.models.telemetry.run_record import RunFacts
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import FAILSAFE_REASON, Level, Status
from spheretwin.models.telemetry.table import Table, rank_lost, saturated
from spheretwin.viz.recording.signals import field_texts

# Two spaces at the end of a line break it, at half of the distance between paragraphs. Headings would take
# two lines each, and a small window has room for three lines.
_LINE_BREAK = "  \n"

_SYMBOLS = {Level.INFO: "✔", Level.WARN: "⚠", Level.ERROR: "✗"}

# Chosen fields that the headline and the line of the faults state.
_STATED = (
    "hardware",
    "controller.law",
    "plant.modelling_error",
    "plant.payload_kg",
    "disturbance.load",
    FAULT,
)

_HEADLINES = {Status.COMPLETED: "COMPLETED", Status.INTERRUPTED: "INTERRUPTED", Status.FAILSAFE: "FAILSAFE"}


class Summary:
    """Figures of a run for its headline, from its rows.

    Parameters
    ----------
    facts : RunFacts
        Facts of the run.

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
        self._last_deg: NDArray[np.float64] = np.zeros(len(ANGLES))
        self._failsafe = ""
        self._faults = FaultLog()

    def add(self, rows: Table, error_deg: NDArray[np.float64]) -> None:
        """Add the rows of a chunk, with the error angle of each."""
        self.last_s = float(rows["t_s"][-1])
        self._ticks += len(rows)
        self._saturated += int(np.count_nonzero(saturated(rows)))
        self._rank_lost += int(np.count_nonzero(rank_lost(rows)))
        # The last rows of a run that diverged may hold no numbers.
        finite_deg = error_deg[np.isfinite(error_deg)]
        self._largest_deg = max(self._largest_deg, float(np.max(finite_deg, initial=0.0)))
        self._squares += float(np.sum(finite_deg**2))
        self._last_deg = np.degrees(rows["q_rad"][-1])
        signals = {signal.name: signal for signal in rows.signals}
        if FAILSAFE_REASON in signals:
            reasons = rows[FAILSAFE_REASON].ravel()
            if reasons[-1]:
                self._failsafe = signals[FAILSAFE_REASON].states[int(reasons[-1])]
        self._faults.write(rows)

    def running(self) -> str:
        """Return the text of a run in progress."""
        return _LINE_BREAK.join([f"**▶ RUNNING · {self._run_text()}**", *self._chosen_lines()])

    def ended(self, status: Status) -> str:
        """Return the text of a run that has ended."""
        headline = _HEADLINES.get(status, "FAILED" if status.level is Level.ERROR else str(status).upper())
        lines = []
        if self._ticks:
            if reason := self._reason(status):
                lines.append(f"**{reason}**")
            lines.append(self._figures())
        lines += [*self._fault_lines(), *self._chosen_lines()]
        return _LINE_BREAK.join([f"**{_SYMBOLS[status.level]} {headline} · {self._run_text()}**", *lines])

    def cut_off(self) -> str:
        """Return the text of a run whose recording was not closed; figures are those of the recorded rows."""
        until = f"the recording was not closed; its rows end at {self.last_s:.3g} s"
        until += f" of {self._facts.duration_s:g} s"
        headline = f"**{_SYMBOLS[Level.WARN]} NOT CLOSED · {self._run_text()}**"
        lines = [f"**{until}**", self._figures(), *self._fault_lines(), *self._chosen_lines()]
        return _LINE_BREAK.join([headline, *lines])

    def _reason(self, status: Status) -> str:
        if status in (Status.COMPLETED, Status.RUNNING):
            return ""
        ended_s = self.last_s + (self._field("controller", "period_s") or 0.0)  # after the last tick
        at = f"{status.replace('_', ' ')} at {ended_s:.3f} s of {self._facts.duration_s:g} s: "
        if status == Status.FAILSAFE and self._failsafe:
            return at + self._failsafe
        if status == Status.LEFT_WORKSPACE:
            angles = ", ".join(f"{name} {deg:.1f}°" for name, deg in zip(ANGLES, self._last_deg, strict=True))
            return f"{at}a hinge reached the end of its range, at the start of this tick {angles}"
        return at + status.text.removesuffix(": the run ends here")

    def _figures(self) -> str:
        rms_deg = np.sqrt(self._squares / self._ticks)
        lost = (
            f" · rank lost {_percent(self._rank_lost / self._ticks)} of the time" if self._rank_lost else ""
        )
        return (
            f"error: largest **{self._largest_deg:.3g}°**, RMS **{rms_deg:.3g}°** ·"
            f" saturated {_percent(self._saturated / self._ticks)} of the time{lost}"
        )

    def fault_onsets(self) -> list[tuple[float, str]]:
        """Return time, part and mode of the start of each fault."""
        return [(fault.start_s, f"{fault.part} {fault.mode}") for fault in self._faults.faults]

    def _fault_lines(self) -> list[str]:
        planned = len(self._field("run", FAULT) or ())
        faults = sorted(self._faults.faults, key=lambda fault: (fault.start_s, fault.part))
        texts = [fault.text() for fault in faults]
        if planned > len(texts):
            texts.append(f"{planned - len(texts)} of {planned} planned faults did not start")
        return [f"faults: {'; '.join(texts)}"] if texts else []

    def _chosen_lines(self) -> list[str]:
        """Return what was chosen or differs from the defaults, and is not in the other lines."""
        fields = {name: value for name, value in self._facts.changed.items() if name not in _STATED}
        texts = [f"{name} {text}" for name, text in field_texts(fields)]
        return [f"chosen: {' · '.join(texts)}"] if texts else []

    def _run_text(self) -> str:
        facts = self._facts
        parts = [f"replay of {facts.replay_of}"] if facts.replay_of else []
        parts.append(f"{facts.name} under {facts.law}")
        parts += [
            f"{symbol} = {value:g}"
            for symbol, section, field in (
                ("modelling error m", "plant", "modelling_error"),
                ("load L", "disturbance", "load"),
            )
            if isinstance(value := self._field(section, field), int | float)
        ]
        if facts.payload_kg:
            parts.append(f"payload {facts.payload_kg:g} kg")
        if hardware := self._field("run", "hardware"):
            parts.append(f"{hardware} hardware")
        return " · ".join(parts)

    def _field(self, section: str, field: str) -> Any:
        return self._facts.sections.get(section, {}).get(field)


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if 0 < share < 0.1 else f"{100 * share:.0f} %"
