"""Where in a recording what a run says of itself stands."""

import rerun as rr

TIMELINE = "sim_time"
TELEMETRY = "telemetry"
SCENARIO = "scenario"
EVENTS = "events"
STATES = "states"


def entity(signal: str) -> str:
    """Entity that holds a signal, at the full rate of the control ticks."""
    return f"{TELEMETRY}/{rr.escape_entity_path_part(signal)}"
