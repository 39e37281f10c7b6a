"""Runs in which nothing acts but what a test adds: what the tests of both knowledges share."""

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.session import Session

ENGINES = ("mujoco", "lagrangian")
PAYLOAD_KG = 0.05
# Nothing acts but what a test adds.
STILL = {
    "disturbance.load": 0.0, "disturbance.random_bound_Nm": 0.0,
    "plant.modelling_error": 0.0, "plant.modelling_torque_Nm": [0.0, 0.0, 0.0],
}  # fmt: skip
PD = STILL | {"controller.law": "pd"}
OFFSET = np.array([0.02, -0.03, 0.05])
# With the detector, MuJoCo's loop is that of the electronics, which is compiled anyway.
ASKEW = {"sensors.angle_offset_rad": OFFSET.tolist(), "detector.detect": True}


def session(name="sinusoid", changes=None, law=None):
    return Session(scenarios.load(name, changes), law)


def table(ticks, name="sinusoid", changes=None, law=None):
    return session(name, changes, law).advance(ticks)


def letting_go(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0


FREE = Law("free", letting_go, [], [])
