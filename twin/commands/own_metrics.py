"""Figures of the user's own: functions of a whole run, named on the command line."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from typing import Any

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import load_function
from spheretwin.models.telemetry.kept import KeptTelemetry
from spheretwin.models.telemetry.status import Status
from spheretwin.twin.records.summary import OwnMetric, check_names, own_value
from spheretwin.twin.session import Session
from spheretwin.twin.simulation import Run


class OwnMetrics:
    """Keeps what functions of the user's are to be handed, and asks them when the run is over.

    Parameters
    ----------
    specs : sequence of str
        Each ``path/to/file.py:name``; the name is that of the figure too.

    Attributes
    ----------
    faults : list of str
        Why a figure is missing; one line each.

    Raises
    ------
    InputError
        A function cannot be loaded, or has the name of another figure.
    """

    def __init__(self, specs: Sequence[str]) -> None:
        self._functions: dict[str, OwnMetric] = {}
        self._kept: KeptTelemetry | None = None
        self.faults: list[str] = []
        for spec in specs:
            name = spec.rpartition(":")[2]
            if name in self._functions:
                raise InputError(f"metric: expected a name of its own for each, received {name} twice")
            self._functions[name] = load_function(spec, f"metric {name}")
        check_names(self._functions)

    def sinks(self, session: Session, ticks: int) -> list[KeptTelemetry]:
        """What is to follow a run of so many ticks: nothing where there is no function.

        Raises
        ------
        InputError
            The telemetry does not fit in memory.
        """
        self._kept = KeptTelemetry(session.signals, ticks) if self._functions else None
        return [self._kept] if self._kept else []

    def values(self, session: Session, status: Status) -> dict[str, Any]:
        """Figure by name; None where a function failed: the run's other figures must not be lost by it."""
        if self._kept is None:
            return {}
        run = Run(session.begun_as, status, self._kept.table, session.loop_s, session.actuator)
        return {name: self._value(name, metric, run) for name, metric in self._functions.items()}

    def _value(self, name: str, metric: OwnMetric, run: Run) -> Any:
        try:
            with contextlib.redirect_stdout(sys.stderr):  # stdout is for the figures alone
                return own_value(name, metric, run)
        except InputError as error:
            self.faults.append(f"{error}")
            return None
