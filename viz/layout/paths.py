"""Where in a recording what a run says of itself stands."""

import rerun as rr

TIMELINE = "sim_time"
TELEMETRY = "telemetry"
DERIVED = "derived"
SCENARIO = "scenario"
SUMMARY = "summary"
EVENTS = "events"
STATES = "states"
CURRENT_MAP = "currents/map"
CURRENT_BARS = "currents/bars"
CURRENT_BARS_STILL = f"{CURRENT_BARS}/still"
PHASE_PLANE = "phase_plane"
ENDED = "ended"


VALUES, STYLES, DESCRIBED = "values", "styles", "described"
"""Components of `TELEMETRY`: what all signals are in each row, how their lines look, what they are.

The first two are structs with a field a signal: each component would cost some bytes more in every row."""

CHECKSUM, TOTAL = "checksum", "total"
"""Components of `TELEMETRY` and `EVENTS`: checksums, and how many rows or lines there are.

A checksum of the telemetry is of the rows of a chunk: number of the first, count, checksum. One of the events
is of a line: its number in the upper 32 bits, the checksum in the lower.
`CHECKSUM` also ends the names of the components that hold the checksum of a text of the same entity."""


def component(kind: str, arrival: int) -> str:
    """Component of the signals that came together: 0 for those of the start; a change of law brings others.

    They have components of their own: of one whose fields change, viewers draw nothing.
    """
    return f"{kind}_{arrival}"


def derived(quantity: str) -> str:
    """Entity that holds a derived quantity."""
    return f"{DERIVED}/{rr.escape_entity_path_part(quantity)}"
