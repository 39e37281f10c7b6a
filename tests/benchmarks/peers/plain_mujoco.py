"""NumPy and MuJoCo in a plain Python loop."""

import numpy as np
import plain
from problem import Problem, bare_rotor

NAME = "NumPy and MuJoCo, a Python loop"


def run(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Return angles (ticks, 3) and currents (ticks, 18) of the first step of each tick."""
    rotor = bare_rotor(problem)
    rotor.start(problem.reference[0, 0], np.zeros(3))
    law = plain.PlainPd(problem.law["stiffness"], problem.law["damping"], problem.nominal_inertia)
    disturbance = problem.disturbance - np.array(problem.scenario.plant.modelling_torque_Nm)
    rows = plain.run(
        rotor.model,
        rotor.data,
        problem.actuator,
        problem.scenario,
        law,
        problem.reference,
        disturbance,
        len(disturbance),
    )
    q, *_, current = zip(*rows, strict=True)
    return np.array(q), np.array(current)
