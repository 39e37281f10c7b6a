"""Logs of a calibrated machine whose parameters change on the way; MuJoCo plays it."""

import numpy as np

import spheretwin
from spheretwin.machine import Log
from spheretwin.machine.workflow import NOMINAL

SCENARIO = "sinusoid"
KNOWN = {**NOMINAL, "plant.payload_kg": 0.1}


def changing_log(duration_s, *changes, seed=0):
    """Log of a run in which fields change at times: ``(t_s, field, value)``."""
    scenario = spheretwin.load(SCENARIO, {**KNOWN, "duration": duration_s, "seed": seed})
    parts, done = [], 0
    with spheretwin.Session(scenario) as session:
        for t_s, field, value in (*changes, (duration_s, None, None)):
            table = session.advance(round(t_s / 1e-3) - done)
            parts.append([table[name].copy() for name in ("t_s", "current_command_A", "q_measured_rad")])
            done = session.tick
            if field:
                session.set(field, value)
    return Log(*(np.concatenate(columns) for columns in zip(*parts, strict=True)), name="log")
