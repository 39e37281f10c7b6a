"""Short runs of content tests, and a brief text of their columns."""

from tests.content.values import array

LAGRANGIAN = {"plant.engine": "lagrangian"}
SHORT = {"duration": 0.04}


def brief(table):
    """Last pose, reference, currents and torque alone."""
    names = {
        "q_rad", "q_ref_rad", "qdot_ref_rad_s", "q_measured_rad", "current_A", "torque_command_Nm",
        "disturbance_Nm",
    }  # fmt: skip
    return [
        f"{signal.name}: {array(table[signal.name][-20:])}"
        for signal in table.signals
        if signal.name in names
    ]
