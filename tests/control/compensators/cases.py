"""Runs whose nominal model is true."""

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
