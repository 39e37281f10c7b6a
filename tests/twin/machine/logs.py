"""Logs of short simulated runs, as a laboratory would record them."""

from functools import cache

import numpy as np

import spheretwin as st
from spheretwin.machine.log import log_of

# Different frequencies on each axis: no exchange of axes leaves the motion as it is.
MULTISINE = {
    "duration": 1.5,
    "controller.law": "computed_torque",
    "trajectory.shape": "multisine",
    "trajectory.components": [
        {"amplitude_rad": [0.2, 0.15, 0.3], "frequency_Hz": [1.3, 1.7, 0.9]},
        {"amplitude_rad": [0.04, 0.05, 0.06], "frequency_Hz": [2.9, 2.3, 3.1], "phase_rad": [1.0, 2.0, 0.5]},
    ],
}

# Loops that other tests compile, too.
ENGINES = {"ideal": "mujoco", "electronics": "mujoco", "prototype": "lagrangian"}


@cache
def run(scenario="hold", hardware="electronics", changes=()):
    return st.simulate(scenario, {"hardware": hardware, "plant.engine": ENGINES[hardware], **dict(changes)})


@cache
def multisine(hardware="electronics"):
    """Log of a multisine on three axes."""
    changes = {"hardware": hardware, "plant.engine": ENGINES[hardware], **MULTISINE}
    return log_of(st.simulate("hold", changes).telemetry)


def relabelled(log, order, signs):
    """The log if hinge i has column order[i] and the sign signs[i]."""
    angles = np.empty_like(log.angle_rad)
    angles[:, list(order)] = log.angle_rad * np.array(signs)
    return angles
