"""Runs whose nominal model is true."""

import numpy as np

from spheretwin import scenario as scenarios


def true_model(name, **changes):
    """Return a scenario in which the nominal model is the plant; fields have __ for a dot.

    With a delay it runs in the loop of the electronics, which other tests compile: the offset of the sensors
    is lost in rounding.
    """
    fields = {
        "plant.engine": "lagrangian", "plant.modelling_error": 0.0, "plant.modelling_torque_Nm": [0, 0, 0],
        "disturbance.load": 0.0, "disturbance.random_bound_Nm": 0.0, "nominal.equals_truth": True,
    }  # fmt: skip
    if changes.get("drive__delay_s"):
        fields |= {"plant.engine": "mujoco", "sensors.angle_offset_rad": [1e-300] * 3}
    return scenarios.load(name, fields | {key.replace("__", "."): value for key, value in changes.items()})


def response(commands, starts_s, lag_s, t):
    """Return the exact response of a lag to commands that switch at some times, from rest."""
    total = before = 0.0
    for command, start_s in zip(commands, starts_s, strict=True):
        if t > start_s:
            total = total + (command - before) * (-np.expm1(-(t - start_s) / lag_s) if lag_s else 1.0)
        before = command
    return total
