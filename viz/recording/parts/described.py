"""What a recording says for those who read it back: facts of the run, what each signal is."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

import rerun as rr

from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.versions import versions

FACTS, SIGNALS = "facts", "signals"
"""Names of the components below."""

RATE = "record_rate_Hz"
"""Among the facts: rows a second that are kept beside those that stand out; null for every row."""

COMPLETE = "t_s"
"""Signal that is recorded behind all others of its rows."""


def facts_as_json(facts: RunFacts, rate_Hz: float | None) -> rr.AnyValues:
    """Facts of a run from its start, the versions that it was made with, and the rate of the rows kept."""
    described = {**asdict(facts), RATE: rate_Hz, "versions": versions()}
    return rr.AnyValues(facts=json.dumps(described, default=str))


def signals_as_json(signals: tuple[Signal, ...]) -> rr.AnyValues:
    """All signals that a run has had so far, in the order of their columns."""
    return rr.AnyValues(signals=json.dumps([asdict(signal) for signal in signals]))


def signals_of(text: str) -> tuple[Signal, ...]:
    """Signals as they were written."""
    return tuple(_signal(fields) for fields in json.loads(text))


def _signal(fields: dict[str, Any]) -> Signal:
    return Signal(**{**fields, **{name: tuple(fields[name]) for name in ("labels", "states")}})
