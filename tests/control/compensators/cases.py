"""Runs whose nominal model is true."""

from spheretwin import scenario as scenarios


def true_model(name, **changes):
    """A scenario in which the nominal model is the plant; fields have __ for a dot."""
    fields = {
        "plant.engine": "lagrangian", "plant.modelling_error": 0.0, "plant.modelling_torque_Nm": [0, 0, 0],
        "disturbance.load": 0.0, "disturbance.random_bound_Nm": 0.0, "nominal.equals_truth": True,
    }  # fmt: skip
    return scenarios.load(name, fields | {key.replace("__", "."): value for key, value in changes.items()})
