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


def entity(signal: str) -> str:
    """Entity that holds a signal, at the full rate of the control ticks."""
    return f"{TELEMETRY}/{rr.escape_entity_path_part(signal)}"


def derived(quantity: str) -> str:
    """Entity that holds a derived quantity."""
    return f"{DERIVED}/{rr.escape_entity_path_part(quantity)}"
