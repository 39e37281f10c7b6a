"""Random poses, and the actuator whose torques are a field."""

import numpy as np

from spheretwin.models.kinematics import rate_jacobian
from spheretwin.scenario.reading import FOLDER

SECOND = FOLDER / "ventusff" / "actuator.xml"
"""Model file of the actuator with a torque field."""


def random_poses(count, seed=0):
    return np.random.default_rng(seed).uniform([-1, -1, -np.pi], [1, 1, np.pi], (count, 3))


def work_around_a_closed_path(matrix, groups):
    """Return the work of constant currents around a loop of the tilt, and the sum of its magnitudes."""
    current = np.random.default_rng(2).normal(size=groups)
    work, power = 0.0, 0.0
    for a in np.linspace(0, 2 * np.pi, 400, endpoint=False):
        q = np.array([0.3 * np.cos(a), 0.2 * np.sin(a), 0.5 * np.cos(a)])
        qdot = np.array([-0.3 * np.sin(a), 0.2 * np.cos(a), -0.5 * np.sin(a)])
        share = (matrix(q) @ current) @ (rate_jacobian(q) @ qdot) / 400
        work, power = work + share, power + abs(share)
    return work, power
