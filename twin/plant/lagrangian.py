"""The Lagrangian as the plant: the rotor's equations of motion under our own Runge-Kutta steps.

It knows nothing of MuJoCo, so that a closed loop run on both says what the engine adds of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.compiled import compiled
from spheretwin.models.errors import InputError
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.lagrangian import GRAVITY_m_s2, acceleration, loaded_inertia


class Equations(NamedTuple):
    """The equations of motion as compiled code sees them; the last four are what the loop reads and sets."""

    step_s: float
    inertia: NDArray[np.float64]  # (3,) kg·m², payload included
    weight_moment: float  # N·m, m g l of the payload
    q: NDArray[np.float64]  # (3,) rad
    qdot: NDArray[np.float64]  # (3,) rad/s
    torque_S: NDArray[np.float64]  # (3,) N·m on the rotor, stator frame
    torque_q: NDArray[np.float64]  # (3,) N·m on the hinges


class LagrangianRotor:
    """The rotor as the Lagrangian has it, set up for one run.

    Parameters
    ----------
    actuator : Actuator
        Its inertia, and where the payload is mounted.
    step_s : float, s
        Physics step.
    integrator : str
        ``RK4``; there is no other.
    modelling_error : float
        m: the rotor's inertia is (1 + m) times that of the actuator (11), (54).
    payload_kg : float, kg
        Point mass at the payload mount; 0 for none.
    gravity_m_s2 : float, m/s²
        Pulls the payload along -z of the stator frame where positive.

    Raises
    ------
    InputError
        Another integrator, or a payload whose mount is not on the rotor's third axis.
    """

    def __init__(
        self,
        actuator: Actuator,
        step_s: float,
        integrator: str = "RK4",
        modelling_error: float = 0.0,
        payload_kg: float = 0.0,
        gravity_m_s2: float = GRAVITY_m_s2,
    ) -> None:
        x, y, height = (float(length) for length in actuator.payload_mount_m)
        if integrator != "RK4":
            raise InputError(f"Lagrangian plant: expected the integrator RK4, received {integrator}")
        if payload_kg and (x or y):
            raise InputError(
                "Lagrangian plant: expected a payload mount on the rotor's third axis,"
                f" received one at ({x:g}, {y:g}, {height:g}) m"
            )
        self._step_s = step_s
        self.inertia = loaded_inertia((1 + modelling_error) * actuator.inertia, payload_kg, height)
        self.weight_moment = payload_kg * gravity_m_s2 * height

    def start(self, q: NDArray[np.float64], qdot: NDArray[np.float64]) -> Equations:
        """Set pose (rad) and rates (rad/s) at time 0; return what compiled code steps."""
        pose, rates = np.array(q, dtype=np.float64), np.array(qdot, dtype=np.float64)
        torques = np.zeros((2, 3))
        return Equations(self._step_s, self.inertia, self.weight_moment, pose, rates, torques[0], torques[1])

    def warnings(self) -> list[str]:
        """None: whatever goes wrong shows in the state, which the loop watches."""
        return []


@compiled
def step(plant: Equations) -> None:
    """One physics step of the classical Runge-Kutta method of order four.

    Both torques are held over the step, the Cartesian one in the stator frame, as MuJoCo does: its effect
    on the hinges is evaluated anew at the pose of each stage.
    """
    h = plant.step_s
    q1, v1 = plant.q.copy(), plant.qdot.copy()
    a1 = _acceleration(plant, q1, v1)
    q2, v2 = q1 + 0.5 * h * v1, v1 + 0.5 * h * a1
    a2 = _acceleration(plant, q2, v2)
    q3, v3 = q1 + 0.5 * h * v2, v1 + 0.5 * h * a2
    a3 = _acceleration(plant, q3, v3)
    q4, v4 = q1 + h * v3, v1 + h * a3
    a4 = _acceleration(plant, q4, v4)
    plant.q[:] = q1 + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
    plant.qdot[:] = v1 + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


@compiled
def _acceleration(plant: Equations, q: NDArray[np.float64], qdot: NDArray[np.float64]) -> NDArray[np.float64]:
    E = rate_jacobian(q)
    torque = np.empty(3)
    for i in range(3):  # torque_q + E^T torque_S
        torque[i] = plant.torque_q[i]
        for j in range(3):
            torque[i] += E[j, i] * plant.torque_S[j]
    return acceleration(q, qdot, torque, plant.inertia, plant.weight_moment)
