"""What a recording says for those who read it back: facts of the run, what each signal is."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict

import rerun as rr

from spheretwin.models.telemetry.checksums import text_checksum
from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.versions import versions
from spheretwin.viz.layout.paths import CHECKSUM, DESCRIBED, component

FACTS = "facts"
FACTS_CHECKSUM = f"{FACTS}_{CHECKSUM}"
"""Names of the components below."""

DESCRIBED_CHECKSUM = f"{DESCRIBED}_{CHECKSUM}"

RATE = "record_rate_Hz"
"""Among the facts: rows a second that are kept beside those that stand out; null for every row."""


def facts_as_json(facts: RunFacts, rate_Hz: float | None) -> rr.AnyValues:
    """Facts of a run from its start, the versions that it was made with, and the rate of the rows kept."""
    text = json.dumps({**asdict(facts), RATE: rate_Hz, "versions": versions()}, default=str)
    return rr.AnyValues(facts=text, facts_checksum=text_checksum(text))


def signals_as_json(arrival: int, signals: Sequence[Signal]) -> list[rr.DescribedComponentBatch]:
    """Signals that come together, in the order of their columns, and the checksum of their text."""
    text = json.dumps([asdict(signal) for signal in signals])
    texts = {DESCRIBED: text, DESCRIBED_CHECKSUM: text_checksum(text)}
    return [
        rr.DescribedComponentBatch(
            rr.components.TextBatch(each), rr.ComponentDescriptor(component(kind, arrival))
        )
        for kind, each in texts.items()
    ]


def signals_of(text: str) -> list[Signal]:
    """Signals as they were written."""
    return [
        Signal(**{**fields, **{name: tuple(fields[name]) for name in ("labels", "states")}})
        for fields in json.loads(text)
    ]
