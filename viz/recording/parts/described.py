"""What a recording says for those who read it back: facts of the run, what each signal is."""

from __future__ import annotations

import json
from dataclasses import asdict

import rerun as rr

from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.versions import versions

FACTS, SIGNAL = "facts", "signal"
"""Names of the components below."""

RATE = "record_rate_Hz"
"""Among the facts: rows a second that are kept beside those that stand out; null for every row."""

COMPLETE = "t_s"
"""Signal that is recorded behind all others of its rows."""


def facts_as_json(facts: RunFacts, rate_Hz: float | None) -> rr.AnyValues:
    """Facts of a run from its start, the versions that it was made with, and the rate of the rows kept."""
    described = {**asdict(facts), RATE: rate_Hz, "versions": versions()}
    return rr.AnyValues(facts=json.dumps(described, default=str))


def signal_as_json(place: int, signal: Signal) -> rr.AnyValues:
    """A signal, and its place among the columns."""
    return rr.AnyValues(signal=json.dumps({"place": place, **asdict(signal)}))


def signal_of(text: str) -> tuple[int, Signal]:
    """Place and signal as they were written."""
    fields = json.loads(text)
    labels, states = (tuple(fields.pop(name)) for name in ("labels", "states"))
    return fields.pop("place"), Signal(**fields, labels=labels, states=states)
