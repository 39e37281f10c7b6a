"""Equations of motion of a machine: closed forms of an ideal joint, or those of a general one.

A general joint has rings with mass, a rotor with its centre of mass anywhere, or hinges that are tilted or
apart. The closed forms are for hinges without mass. MuJoCo admits no ring without mass: the ones of 1.1e-15
kg·m² in the shipped models are neglected, and the bounds of the comparisons contain their share.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from spheretwin.linear import Magnetics, hinge_matrix
from spheretwin.models.actuator import MJCF_PATH, Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.record import Rows
from spheretwin.models.joint_chain import (
    JointChain,
    acceleration_at,
    chain_at,
    equations,
    fill_chain,
    fill_ideal,
    ideal_pose,
    inertia_at,
)
from spheretwin.models.kinematics import rate_jacobian, triple
from spheretwin.models.lagrangian import coriolis_matrix
from spheretwin.models.mjcf import PAYLOAD, ROTOR, beyond_an_ideal_joint, read

NEGLIGIBLE_RINGS = 1e-9
"""Share of the rotor's inertia from which on rings are part of the equations of motion."""


class Equations(NamedTuple):
    """Equations of motion (1) of a machine without payload and gravity.

    An unbalanced rotor falls: without gravity, small differences do not grow along a motion.
    """

    joint: Rows
    """Array of one joint, an ideal or a general one."""
    neglected: float
    """Inertia of the rings that they neglect, over that of the rotor."""

    def inertia_matrix(self, q: Array) -> Array:
        """Return M (3, 3) at a pose, kg·m²."""
        joint = self.joint[0]
        return symmetric(inertia_at(joint, triple(joint.inertia), triple(q)))

    def torque(self, q: Array, qdot: Array, qddot: Array) -> Array:
        """Return the torque on the hinges (3,) of a motion, N·m."""
        joint = self.joint[0]
        if joint.on:
            bias = np.array(equations(joint, triple(q), triple(qdot))[1])
        else:
            bias = coriolis_matrix(q, qdot, joint.inertia) @ qdot
        return np.asarray(self.inertia_matrix(q) @ qddot + bias)

    def flow(self, state: Array, torque: Array) -> Array:
        """Return the derivative of the state (6,) under torques on the hinges."""
        joint, q, qdot = self.joint[0], triple(state), triple(state[3:])
        qddot = acceleration_at(joint, triple(joint.inertia), 0.0, q, qdot, triple(torque))
        return np.concatenate([qdot, qddot])

    def hinge_matrix(self, q: Array, magnetics: Magnetics) -> Array:
        """Return the torque on the hinges per current (3, n) at a pose, N·m/A."""
        joint = self.joint[0]
        if not joint.is_tilted:
            return hinge_matrix(q, magnetics)
        ideal_q, rates = np.empty((2, 3))
        ideal_pose(joint, q, np.zeros(3), ideal_q, rates)
        torque_S = np.linalg.solve(rate_jacobian(ideal_q).T, hinge_matrix(ideal_q, magnetics))
        axes: Array = np.array(chain_at(joint, triple(q))[1])
        return axes @ torque_S


def equations_of(mjcf: Path, actuator: Actuator) -> Equations:
    """Return the equations of motion of a model file.

    Parameters
    ----------
    mjcf : Path
        Model file.
    actuator : Actuator
        Its inertia is that of an ideal joint.
    """
    model, share = read(mjcf).bare, ring_share(mjcf, actuator)
    joint = JointChain.filled(fill_ideal, actuator.inertia)
    if share > NEGLIGIBLE_RINGS or beyond_an_ideal_joint(model):
        fill_chain(joint, model)
        joint["gravity"], share = 0.0, 0.0
    return Equations(joint, share)


def ring_share(mjcf: Path, actuator: Actuator) -> float:
    """Return the inertia of rings and other moving bodies over that of the rotor."""
    model = read(mjcf).bare
    moving = [
        float(model.body_inertia[body].max())
        for body in np.flatnonzero(model.body_weldid)
        if model.body(body).name not in (ROTOR, PAYLOAD)
    ]
    return sum(moving) / float(actuator.inertia.min())


def ideal_file(mjcf: Path, actuator: Actuator) -> Path:
    """Return a model file with an ideal joint: that of the machine, or else the shipped one.

    Exact solutions of one rotor or one hinge need such a joint; they take the inertia of the machine.
    """
    return MJCF_PATH if equations_of(mjcf, actuator).joint["on"][0] else mjcf


def symmetric(entries: tuple[float, ...]) -> Array:
    """Return the matrix (3, 3) with the entries αα, ββ, γγ, αβ, αγ, βγ."""
    aa, bb, cc, ab, ac, bc = entries
    return np.array([[aa, ab, ac], [ab, bb, bc], [ac, bc, cc]])
