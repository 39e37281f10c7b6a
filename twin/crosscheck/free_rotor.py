"""The rotor without torque: it keeps its energy and its angular momentum, and Euler's motion is exact."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.check import Check
from spheretwin.models.kinematics import rotation, rotor_rate_jacobian
from spheretwin.models.mjcf import read
from spheretwin.twin.crosscheck.part import Part
from spheretwin.twin.plant.engine import Rotor

Array = NDArray[np.float64]

DURATION_s = 60.0
SAMPLE_s = 0.02
STEP_s = 5e-4  # the default physics step
START_rad = np.array([0.1, -0.2, 0.0])
NODDING = np.array([0.08, 0.05, 1.0])  # rates of α and β as shares of the spin
SPINS_rad_s = {"2π": 2 * np.pi, "30": 30.0}

# The gimbal rings, which the formulas below do not have: 6e-13 of the rotor's inertia.
RINGS = 1e-12


class Motion(NamedTuple):
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


class Drift(NamedTuple):
    """A quantity that should stay at zero, and its bound."""

    values: Array  # (n,)
    bound: float


class FreeRotor(NamedTuple):
    """Checks, and the drifts they were taken from: by quantity, then by spin."""

    checks: list[Check]
    t_s: Array
    drifts: dict[str, dict[str, Drift]]


def check(mjcf: Path, actuator: Actuator) -> FreeRotor:
    """Let the rotor spin freely in the engine at two rates, as it is and with J1 = J2.

    Parameters
    ----------
    mjcf : Path
        Model file that the engine reads.
    actuator : Actuator
        Its inertia is what energy and momentum are made of.
    """
    drifts: dict[str, dict[str, Drift]] = {"energy": {}, "angular momentum": {}, "attitude": {}}
    t_s = np.zeros(0)
    for name, spin in SPINS_rad_s.items():
        free = fly(mjcf, actuator.inertia, spin)
        nods = _nodding_share(free)
        truncation = (spin * STEP_s) ** 4
        drifts["energy"][name] = Drift(
            np.abs(free.energy_J / free.energy_J[0] - 1), nods**2 * truncation + RINGS
        )
        drifts["angular momentum"][name] = Drift(_momentum_drift(free), nods * truncation + RINGS)
        axisymmetric = fly(mjcf, actuator.inertia[[0, 0, 2]], spin)
        turned = spin * DURATION_s
        drifts["attitude"][name] = Drift(_attitude_error(axisymmetric), turned * (truncation / 120 + RINGS))
        t_s = free.t_s
    checks = [
        _check(quantity, spin, drift) for quantity in drifts for spin, drift in drifts[quantity].items()
    ]
    return FreeRotor(checks, t_s, drifts)


def fly(mjcf: Path, inertia: Array, spin_rad_s: float) -> Motion:
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
    rotor = Rotor(read(mjcf), STEP_s, "RK4", 0.0, 0.0)
    rotor.model.body("rotor").inertia = inertia
    mujoco.mj_setConst(rotor.model, rotor.data)
    plant = rotor.start(START_rad, spin_rad_s * NODDING)
    count = round(DURATION_s / SAMPLE_s)
    R_SR, w_SR_R = np.empty((count + 1, 3, 3)), np.empty((count + 1, 3))
    for i in range(count + 1):
        R_SR[i], w_SR_R[i] = rotation(plant.q), rotor_rate_jacobian(plant.q) @ plant.qdot
        mujoco.mj_step(rotor.model, rotor.data, nstep=round(SAMPLE_s / STEP_s))
    return Motion(SAMPLE_s * np.arange(count + 1, dtype=np.float64), R_SR, w_SR_R, inertia)


def euler_attitude(motion: Motion) -> Array:
    """Attitude of an axisymmetric rotor at each time, exact, from its state at time 0.

    With J1 = J2 the third axis turns about the fixed angular momentum H at H/J1, and the rotor turns about
    its third axis at (1 - J3/J1) w3 beside (Landau and Lifshitz, Mechanics, section 33).
    """
    J1, _, J3 = motion.inertia
    precession = motion.t_s[:, None] * motion.momentum_S[0] / J1
    own_spin = motion.t_s[:, None] * (1 - J3 / J1) * motion.w_SR_R[0, 2] * np.array([0, 0, 1])
    turned = Rotation.from_rotvec(precession) * Rotation.from_matrix(motion.R_SR[0])
    attitude: Array = (turned * Rotation.from_rotvec(own_spin)).as_matrix()
    return attitude


def _momentum_drift(motion: Motion) -> Array:
    H = motion.momentum_S
    drift: Array = np.linalg.norm(H - H[0], axis=1) / np.linalg.norm(H[0])
    return drift


def _attitude_error(motion: Motion) -> Array:
    """(n,) angle between the motion and Euler's, rad."""
    apart = euler_attitude(motion).transpose(0, 2, 1) @ motion.R_SR
    # The sine from the antisymmetric part: an arc cosine alone loses half the digits of a small angle.
    antisymmetric = 0.5 * (apart - apart.transpose(0, 2, 1))
    sine = np.linalg.norm(antisymmetric, axis=(1, 2)) / np.sqrt(2)
    cosine = 0.5 * (np.trace(apart, axis1=1, axis2=2) - 1)
    return np.arctan2(sine, cosine)


def _nodding_share(motion: Motion) -> float:
    """Rate across the third axis over the whole rate, at the start."""
    w = motion.w_SR_R[0]
    return float(np.hypot(w[0], w[1]) / np.linalg.norm(w))


_COMPARED = {
    "energy": "energy with its start, relative",
    "angular momentum": "angular momentum in the stator frame with its start, relative",
    "attitude": "attitude with Euler's exact solution at J1 = J2, angle between them",
}
_WHY = {
    "energy": "the gimbal rings (1e-12), and (ωh)⁴ of the share of the energy that nods at the spin rate:"
    " a fourth-order step's truncation, with its coefficient, 1/120 or less, as the margin",
    "angular momentum": "the gimbal rings (1e-12), and (ωh)⁴ of the share of the momentum that turns with the"
    " spin: a fourth-order step's truncation, with its coefficient, 1/120 or less, as the margin",
    "attitude": "phase error of a fourth-order step, (ωh)⁴/120 of the angle turned, which is ωT;"
    " and 1e-12 of that angle for the gimbal rings",
}


def _check(quantity: str, spin: str, drift: Drift) -> Check:
    return Check(
        name=f"torque-free rotor at {spin} rad/s: {quantity}",
        compares=f"MuJoCo RK4 at {1e3 * STEP_s:g} ms over {DURATION_s:g} s, {_COMPARED[quantity]}",
        states=len(drift.values),
        value=float(np.max(drift.values)),
        bound=drift.bound,
        why=_WHY[quantity],
        unit="rad" if quantity == "attitude" else "1",
    )


PART = Part("torque-free rotor", lambda on: check(on.mjcf, on.actuator))
