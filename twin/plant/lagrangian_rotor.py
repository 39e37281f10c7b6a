"""Lagrangian rotor engine: equations of motion with Runge-Kutta steps.

It is independent of MuJoCo, so that a closed loop on both engines shows the errors of an engine.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from spheretwin.models import mjcf
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import Rows, put
from spheretwin.models.joint_chain import JointChain, acceleration_at
from spheretwin.models.kinematics import Triple, triple
from spheretwin.plant.rotor import EngineKind, RotorData, RotorSettings


class LagrangianRotor:
    """Rotor of a run, or of n rows, with the Lagrangian equations of motion.

    Parameters
    ----------
    joint : array of JointChain, one for each row
    step_s : float or (n, 1) array, s
        Physics step.

    Attributes
    ----------
    rows : array of RotorData
    """

    def __init__(self, joint: Rows, step_s: ArrayLike) -> None:
        self.rows = RotorData.zeros(len(joint))
        put(self.rows, step_s=step_s)
        self.rows["joint"] = joint

    @property
    def joint(self) -> Rows:
        """Array of JointChain."""
        return self.rows["joint"]

    def start(self, q: ArrayLike, qdot: ArrayLike) -> Any:
        """Set pose and rates at time 0; return the first record, which compiled code steps.

        Parameters
        ----------
        q : (3,) or (n, 3) array, rad
            Hinge angles.
        qdot : (3,) or (n, 3) array, rad/s
            Hinge rates.
        """
        put(self.rows, q=q, qdot=qdot, torque_q=0.0)
        return self.rows[0]

    def state(self) -> list[Array]:
        """Return the complete state of each row."""
        return list(np.concatenate([self.rows["q"], self.rows["qdot"]], axis=1))

    def restore(self, states: Sequence[Array]) -> None:
        """Restore the state of each row."""
        self.rows["q"], self.rows["qdot"] = np.hsplit(np.array(states), 2)


@allocation_free  # inlined, it makes the loop 7 % slower
def step(rotor: RotorData) -> None:
    """Advance by one physics step; the torque on the hinges is held over it, as in MuJoCo."""
    joint, torque_q = rotor.joint, triple(rotor.torque_q)
    inertia, moment = triple(joint.inertia), joint.weight_moment
    runge_kutta(rotor.step_s, joint, inertia, moment, torque_q, rotor.q, rotor.qdot)


@inlined
def runge_kutta(
    h: float, joint: JointChain, inertia: Triple, weight_moment: float, torque: Triple, q: Array, qdot: Array
) -> None:
    """Advance pose and rates by a step h (s) of the classical Runge-Kutta method of order four.

    The stages use tuples: nothing is allocated, and a step takes a tenth of the time with arrays of three.
    `inertia` and `weight_moment` are those of an ideal joint.
    """
    q1, v1 = triple(q), triple(qdot)
    a1 = acceleration_at(joint, inertia, weight_moment, q1, v1, torque)
    q2, v2 = _moved(q1, 0.5 * h, v1), _moved(v1, 0.5 * h, a1)
    a2 = acceleration_at(joint, inertia, weight_moment, q2, v2, torque)
    q3, v3 = _moved(q1, 0.5 * h, v2), _moved(v1, 0.5 * h, a2)
    a3 = acceleration_at(joint, inertia, weight_moment, q3, v3, torque)
    q4, v4 = _moved(q1, h, v3), _moved(v1, h, a3)
    a4 = acceleration_at(joint, inertia, weight_moment, q4, v4, torque)
    for i in range(3):
        q[i] = q1[i] + h / 6 * (v1[i] + 2 * v2[i] + 2 * v3[i] + v4[i])
        qdot[i] = v1[i] + h / 6 * (a1[i] + 2 * a2[i] + 2 * a3[i] + a4[i])


@inlined
def _moved(start: Triple, time: float, rate: Triple) -> Triple:
    return start[0] + time * rate[0], start[1] + time * rate[1], start[2] + time * rate[2]


def _set_up(settings: RotorSettings) -> LagrangianRotor:
    supported = () if settings.gravity_m_s2 is None else (mjcf.OTHER_GRAVITY,)
    unsupported = [name for name in settings.model.unknown_to_the_lagrangian if name not in supported]
    if unsupported:
        raise InputError(
            "Lagrangian plant: expected rigid bodies on three hinges, received a model with"
            f" {', '.join(unsupported)}; plant.engine mujoco computes it"
        )
    if settings.integrator != "RK4":
        raise InputError(f"Lagrangian plant: expected the integrator RK4, received {settings.integrator}")
    joint = JointChain.zeros(settings.rows)
    settings.fill_joint(joint)
    return LagrangianRotor(joint, settings.step_s)


LAGRANGIAN = EngineKind("lagrangian", _set_up, step)
