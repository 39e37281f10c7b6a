"""Logs of a calibrated machine whose parameters change on the way; MuJoCo plays it."""

import spheretwin
from spheretwin.machine.log import log_of
from spheretwin.machine.workflow import NOMINAL

SCENARIO = "sinusoid"
KNOWN = {**NOMINAL, "plant.payload_kg": 0.1}


def changing_log(duration_s, *changes, seed=0):
    """Log of a run in which fields change at times: ``(t_s, field, value)``."""
    events = [{"t_s": round(t_s, 3), "set": field, "value": value} for t_s, field, value in changes]
    fields = {**KNOWN, "duration": duration_s, "seed": seed, "event": events}
    return log_of(spheretwin.simulate(SCENARIO, fields).telemetry)
