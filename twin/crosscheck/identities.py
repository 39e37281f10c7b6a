"""Identities of the Lagrangian model: skew symmetry, and the paper's coupling terms."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spheretwin.crosscheck.dynamics import random_states
from spheretwin.crosscheck.equations import ideal_file, ring_share
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check
from spheretwin.models.kinematics import rotation, rotor_rate_jacobian
from spheretwin.models.lagrangian import coriolis_matrix, coupling_torques, inertia_matrix
from spheretwin.models.mjcf import read
from spheretwin.plant.mass_properties import true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor

Array = NDArray[np.float64]

# A handful of products and sums, each rounded at 1e-16, divided by the size of the terms.
BOUND = 1e-14

_WHY_EXACT = "rounding alone, near 1e-16: both sides are exact"


class Identities(NamedTuple):
    """Checks without a figure."""

    checks: list[Check]


def check_identities(actuator: Actuator, count: int) -> Identities:
    """Check the identities at random states."""
    states = random_states(count)
    return Identities(
        [
            _skew_symmetry(actuator.inertia, states.q, states.qdot),
            _coupling(float(np.mean(actuator.inertia)), states.q, states.qdot, states.qddot),
        ]
    )


def inertia_rate(q: Array, qdot: Array, inertia: Array) -> Array:
    """Rate of M(q) along the motion, from kinematics alone: neither Christoffel symbols nor differences.

    ``M = B^T J B``, and the columns of B are the hinge axes seen from the rotor. The axis of γ is fixed
    there; that of β turns about it at -γ̇; that of α, fixed in the stator, turns at minus the rotor's
    angular velocity. So Ḃ is exact, and ``Mdot = Bdot^T J B + B^T J Bdot``.

    Parameters
    ----------
    q, qdot : (3,) array, rad and rad/s
        State.
    inertia : (3,) array, kg·m²
        Principal inertias.

    Returns
    -------
    (3, 3) array, kg·m²/s
        Exact to rounding.
    """
    B = rotor_rate_jacobian(q)
    w_SR_R = B @ qdot
    B_rate = np.stack(
        [-np.cross(w_SR_R, B[:, 0]), -np.cross(qdot[2] * B[:, 2], B[:, 1]), np.zeros(3)], axis=1
    )
    half: Array = B_rate.T @ (inertia[:, None] * B)
    return half + half.T


def _skew_symmetry(inertia: Array, q: Array, qdot: Array) -> Check:
    worst = 0.0
    for pose, rates in zip(q, qdot, strict=True):
        M_rate = inertia_rate(pose, rates, inertia)
        C = coriolis_matrix(pose, rates, inertia)
        symmetric = M_rate - C - C.T  # half of (Ṁ - 2C) + (Ṁ - 2C)ᵀ
        size = np.linalg.norm(M_rate) + 2 * np.linalg.norm(C)
        worst = np.maximum(worst, np.linalg.norm(symmetric) / size)
    return Check(
        name="Ṁ - 2C is skew-symmetric",
        compares="Ṁ from the turning of the hinge axes, C from the Christoffel form;"
        " symmetric part over |Ṁ| + 2|C|",
        states=len(q),
        value=float(worst),
        bound=BOUND,
        why=_WHY_EXACT,
    )


def _coupling(J: float, q: Array, qdot: Array, qddot: Array) -> Check:
    equal = np.full(3, J)
    worst = 0.0
    for pose, rates, accelerations in zip(q, qdot, qddot, strict=True):
        M, C = inertia_matrix(pose, equal), coriolis_matrix(pose, rates, equal)
        full = M @ accelerations + C @ rates
        terms = J * accelerations + coupling_torques(pose, rates, accelerations, J).sum(axis=0)
        size = np.linalg.norm(M) * np.linalg.norm(accelerations) + np.linalg.norm(C) * np.linalg.norm(rates)
        worst = np.maximum(worst, np.linalg.norm(full - terms) / size)
    return Check(
        name="coupling torques (3)-(10)",
        compares="M q̈ + C q̇ at J1 = J2 = J3 with the paper's terms; difference over |M||q̈| + |C||q̇|",
        states=len(q),
        value=float(worst),
        bound=BOUND,
        why=_WHY_EXACT,
    )


DURATION_s = 60.0
SAMPLE_s = 0.02
STEP_s = 5e-4  # the default physics step
START_rad = np.array([0.1, -0.2, 0.0])
NODDING = np.array([0.08, 0.05, 1.0])  # rates of α and β as shares of the spin
SPINS_rad_s = {"2π": 2 * np.pi, "30": 30.0}


class FreeMotion(NamedTuple):
    """A rotor in flight; one row a sample."""

    t_s: Array  # (n,)
    R_SR: Array  # (n, 3, 3)
    w_SR_R: Array  # (n, 3) rad/s
    inertia: Array  # (3,) kg·m²

    @property
    def energy_J(self) -> Array:
        """(n,) kinetic energy."""
        return 0.5 * np.sum(self.inertia * self.w_SR_R**2, axis=1)

    @property
    def momentum_S(self) -> Array:
        """(n, 3) angular momentum in the stator frame, kg·m²/s."""
        return np.einsum("nij,nj->ni", self.R_SR, self.inertia * self.w_SR_R)


class BoundedDrift(NamedTuple):
    """A quantity that should stay at zero, and its bound."""

    values: Array  # (n,)
    bound: float


class FreeRotor(NamedTuple):
    """Checks, and the drifts they were taken from: by quantity, then by spin."""

    checks: list[Check]
    t_s: Array
    drifts: dict[str, dict[str, BoundedDrift]]


def check_free_rotor(mjcf: Path, actuator: Actuator) -> FreeRotor:
    """Let the rotor spin freely in the engine at two rates, on an ideal joint, as it is and with J1 = J2.

    Parameters
    ----------
    mjcf : Path
        Model file that the engine reads.
    actuator : Actuator
        Its inertia is what energy and momentum are made of.
    """
    mjcf = ideal_file(mjcf, actuator)
    rings = ring_share(mjcf, actuator)
    drifts: dict[str, dict[str, BoundedDrift]] = {"energy": {}, "angular momentum": {}, "attitude": {}}
    t_s = np.zeros(0)
    for name, spin in SPINS_rad_s.items():
        free = fly(mjcf, actuator.inertia, spin)
        nods = _nodding_share(free)
        truncation = (spin * STEP_s) ** 4
        drifts["energy"][name] = BoundedDrift(
            np.abs(free.energy_J / free.energy_J[0] - 1), nods**2 * truncation + rings
        )
        drifts["angular momentum"][name] = BoundedDrift(_momentum_drift(free), nods * truncation + rings)
        axisymmetric = fly(mjcf, actuator.inertia[[0, 0, 2]], spin)
        fastest = spin * max(1.0, float(actuator.inertia[2] / actuator.inertia[0]))
        shares = (fastest * STEP_s) ** 4 / 120 + rings
        drifts["attitude"][name] = BoundedDrift(_attitude_error(axisymmetric), fastest * DURATION_s * shares)
        t_s = free.t_s
    checks = [
        _drift_check(quantity, spin, drift) for quantity in drifts for spin, drift in drifts[quantity].items()
    ]
    return FreeRotor(checks, t_s, drifts)


def fly(mjcf: Path, inertia: Array, spin_rad_s: float) -> FreeMotion:
    """Motion without torque in MuJoCo.

    Parameters
    ----------
    mjcf : Path
        Model file.
    inertia : (3,) array, kg·m²
        Principal inertias that the rotor is given.
    spin_rad_s : float, rad/s
        Rate of γ at the start; those of α and β are shares of it.

    Raises
    ------
    InputError
        The model cannot be read.
    """
    rotor = MujocoRotor([true_model(read(mjcf))], STEP_s, "RK4")
    rotor.model.body("rotor").inertia = inertia
    mujoco.mj_setConst(rotor.model, rotor.data)
    rotor.start(START_rad, spin_rad_s * NODDING)
    q, qdot = rotor.data.qpos, rotor.data.qvel
    count = round(DURATION_s / SAMPLE_s)
    R_SR, w_SR_R = np.empty((count + 1, 3, 3)), np.empty((count + 1, 3))
    for i in range(count + 1):
        R_SR[i], w_SR_R[i] = rotation(q), rotor_rate_jacobian(q) @ qdot
        mujoco.mj_step(rotor.model, rotor.data, nstep=round(SAMPLE_s / STEP_s))
    return FreeMotion(SAMPLE_s * np.arange(count + 1, dtype=np.float64), R_SR, w_SR_R, inertia)


def euler_attitude(motion: FreeMotion) -> Array:
    """Attitude of an axisymmetric rotor at each time, exact, from its state at time 0.

    With J1 = J2 the third axis turns about the fixed angular momentum H at H/J1, and the rotor turns about
    its third axis at (1 - J3/J1) w3 in addition (Landau and Lifshitz, Mechanics, section 33).
    """
    J1, _, J3 = motion.inertia
    precession = motion.t_s[:, None] * motion.momentum_S[0] / J1
    own_spin = motion.t_s[:, None] * (1 - J3 / J1) * motion.w_SR_R[0, 2] * np.array([0, 0, 1])
    turned = Rotation.from_rotvec(precession) * Rotation.from_matrix(motion.R_SR[0])
    attitude: Array = (turned * Rotation.from_rotvec(own_spin)).as_matrix()
    return attitude


def _momentum_drift(motion: FreeMotion) -> Array:
    H = motion.momentum_S
    drift: Array = np.linalg.norm(H - H[0], axis=1) / np.linalg.norm(H[0])
    return drift


def _attitude_error(motion: FreeMotion) -> Array:
    """(n,) angle between the motion and Euler's, rad."""
    apart = euler_attitude(motion).transpose(0, 2, 1) @ motion.R_SR
    # The sine from the antisymmetric part: an arc cosine alone loses half the digits of a small angle.
    antisymmetric = 0.5 * (apart - apart.transpose(0, 2, 1))
    sine = np.linalg.norm(antisymmetric, axis=(1, 2)) / np.sqrt(2)
    cosine = 0.5 * (np.trace(apart, axis1=1, axis2=2) - 1)
    return np.arctan2(sine, cosine)


def _nodding_share(motion: FreeMotion) -> float:
    """Rate across the third axis over the whole rate, at the start."""
    w = motion.w_SR_R[0]
    return float(np.hypot(w[0], w[1]) / np.linalg.norm(w))


_COMPARED = {
    "energy": "energy with its start, relative",
    "angular momentum": "angular momentum in the stator frame with its start, relative",
    "attitude": "attitude with Euler's exact solution at J1 = J2, angle between them",
}
_WHY = {
    "energy": "the share of the gimbal rings in the inertia, and (ωh)⁴ of the share of the energy that nods"
    " at the spin rate: a fourth-order step's truncation, with its coefficient, 1/120 or less, as the margin",
    "angular momentum": "the share of the gimbal rings in the inertia, and (ωh)⁴ of the share of the momentum"
    " that turns with the spin: a fourth-order step's truncation, with its coefficient, 1/120 or less, as the"
    " margin",
    "attitude": "phase error of a fourth-order step, (ωh)⁴/120 of the angle turned, which is ωT, with the"
    " faster of spin and precession as ω;"
    " and that angle times the share of the gimbal rings in the inertia",
}


def _drift_check(quantity: str, spin: str, drift: BoundedDrift) -> Check:
    return Check(
        name=f"torque-free rotor at {spin} rad/s: {quantity}",
        compares=f"MuJoCo RK4 at {1e3 * STEP_s:g} ms over {DURATION_s:g} s, {_COMPARED[quantity]}",
        states=len(drift.values),
        value=float(np.max(drift.values)),
        bound=drift.bound,
        why=_WHY[quantity],
        unit="rad" if quantity == "attitude" else "1",
    )
