"""Equations of motion of a machine: closed forms of an ideal joint, or those of a general one.

A general joint has rings with mass, a rotor with its centre of mass anywhere, or hinges that are tilted or
apart. The closed forms are for hinges without mass. MuJoCo admits no ring without mass: the ones of 1.1e-15
kg·m² in the shipped models are neglected, and the bounds of the comparisons contain their share.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.linear import Magnetics, hinge_matrix
from spheretwin.models.actuator import MJCF_PATH, Actuator
from spheretwin.models.joint_chain import (
    JointChain,
    acceleration_at,
    chain_at,
    equations,
    ideal_pose,
    read_chain,
)
from spheretwin.models.kinematics import rate_jacobian, triple
from spheretwin.models.lagrangian import acceleration, coriolis_matrix, inertia_matrix
from spheretwin.models.mjcf import PAYLOAD, ROTOR, beyond_an_ideal_joint, read

Array = NDArray[np.float64]

NEGLIGIBLE_RINGS = 1e-9
"""Share of the rotor's inertia from which on rings are part of the equations of motion."""


class Equations(NamedTuple):
    """Equations of motion (1) of a machine without payload and gravity.

    An unbalanced rotor falls: without gravity, small differences do not grow along a motion.
    """

    inertia: Array
    """(3,) kg·m²: principal inertias of the ideal joint."""
    chain: JointChain | None
    """General joint; None for an ideal one."""
    neglected: float
    """Inertia of the rings that they neglect, over that of the rotor."""

    def inertia_matrix(self, q: Array) -> Array:
        """Return M (3, 3) at a pose, kg·m²."""
        if self.chain is None:
            return inertia_matrix(q, self.inertia)
        return symmetric(equations(self.chain, triple(q), (0.0, 0.0, 0.0))[0])

    def torque(self, q: Array, qdot: Array, qddot: Array) -> Array:
        """Return the torque on the hinges (3,) of a motion, N·m."""
        if self.chain is None:
            bias: Array = coriolis_matrix(q, qdot, self.inertia) @ qdot
        else:
            bias = np.array(equations(self.chain, triple(q), triple(qdot))[1])
        return self.inertia_matrix(q) @ qddot + bias

    def flow(self, state: Array, torque: Array) -> Array:
        """Return the derivative of the state (6,) under torques on the hinges."""
        q, qdot = state[:3].copy(), state[3:].copy()
        if self.chain is None:
            return np.concatenate([qdot, acceleration(q, qdot, torque, self.inertia, 0.0)])
        qddot = acceleration_at(self.chain, self.inertia, 0.0, triple(q), triple(qdot), triple(torque))
        return np.concatenate([qdot, qddot])

    def hinge_matrix(self, q: Array, magnetics: Magnetics) -> Array:
        """Return the torque on the hinges per current (3, n) at a pose, N·m/A."""
        if self.chain is None or self.chain.has_ideal_hinges:
            return hinge_matrix(q, magnetics)
        ideal_q, rates = np.empty((2, 3))
        ideal_pose(self.chain, q, np.zeros(3), ideal_q, rates)
        torque_S = np.linalg.solve(rate_jacobian(ideal_q).T, hinge_matrix(ideal_q, magnetics))
        axes: Array = np.array(chain_at(self.chain, triple(q))[1])
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
    is_general = share > NEGLIGIBLE_RINGS or bool(beyond_an_ideal_joint(model))
    if not is_general:
        return Equations(actuator.inertia, None, share)
    return Equations(actuator.inertia, read_chain(model)._replace(gravity=(0.0, 0.0, 0.0)), 0.0)


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
    return mjcf if equations_of(mjcf, actuator).chain is None else MJCF_PATH


def symmetric(entries: tuple[float, ...]) -> Array:
    """Return the matrix (3, 3) with the entries αα, ββ, γγ, αβ, αγ, βγ."""
    aa, bb, cc, ab, ac, bc = entries
    return np.array([[aa, ab, ac], [ab, bb, bc], [ac, bc, cc]])
