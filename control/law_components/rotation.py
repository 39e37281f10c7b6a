r"""Rotation error of the rotor, and the torque of a law on rotations.

A law on rotations has no Euler angles in its error. Hinge angles and rates of measurement and reference
become unit quaternions and angular velocities in the rotor frame, which are products of sines and cosines;
the torque is returned in the stator frame (`Law.cartesian`). Nothing is divided by cos β, so that no term
grows at the singular pose β = ±90°.

*Error.* With R and R_d of the rotor and of the reference, the error is the rotation R_dᵀR by an angle θ about
a unit axis n. Its quaternion is (η, ε) = (cos θ/2, n sin θ/2), with the sign that makes η ≥ 0: the shorter
way.

    e_R = ½ vee(R_dᵀR − RᵀR_d) = 2 η ε = n sin θ,      e_Ω = Ω − RᵀR_d Ω_d,
    ε' = ½ (η e_Ω + ε × e_Ω),                          (2|ε|²)' = (1 − cos θ)' = e_R · e_Ω.

A common rotation of rotor and reference in the stator frame leaves e_R and e_Ω as they are.

*Torque.* With the acceleration of the reference in the rotor frame, α_d = RᵀR_d Ω̇_d − Ω × RᵀR_d Ω_d, the
torque R (J (α_d + v) + Ω × JΩ) gives e_Ω' = v for the nominal inertia J and no load.
"""

from typing import NamedTuple

from spheretwin.control.law_components.parameters import LawParameters
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.kinematics import Triple, triple, turns


class RotationLaw(LawParameters):
    """Base class of the parameters of laws on rotations: their step writes the Cartesian torque."""


class Quaternion(NamedTuple):
    """Unit quaternion of a rotation."""

    scalar: float
    vector: Triple


class RotationError(NamedTuple):
    """Rotation error and its rate, in the rotor frame."""

    pose: Quaternion  # R_SR of the rotor
    quaternion: Quaternion  # η ≥ 0 and ε of R_dᵀR
    velocity: Triple  # Ω of the rotor, rad/s
    rate: Triple  # e_Ω, rad/s
    acceleration: Triple  # α_d, rad/s²


@allocation_free
def rotation_error(reference: Array, measurement: Array) -> RotationError:
    """Return the rotation error of a measurement.

    Parameters
    ----------
    reference : (3, 3) array
        Desired angle, rate and acceleration of the hinges as rows, rad, rad/s and rad/s².
    measurement : (3, 3) array
        Angle and rate as the first rows.
    """
    q, qdot, q_d, qdot_d = (
        triple(measurement[0]),
        triple(measurement[1]),
        triple(reference[0]),
        triple(reference[1]),
    )
    pose, desired = pose_quaternion(q), pose_quaternion(q_d)
    error = _product(_inverse(desired), pose)
    if error.scalar < 0.0:
        error = Quaternion(-error.scalar, scaled(-1.0, error.vector))
    back = _inverse(error)
    at_rest = (0.0, 0.0, 0.0)
    velocity, _ = rotor_motion(q, qdot, at_rest)
    velocity_d, acceleration_d = rotor_motion(q_d, qdot_d, triple(reference[2]))
    carried = rotated(back, velocity_d)
    acceleration = plus(rotated(back, acceleration_d), scaled(-1.0, cross(velocity, carried)))
    return RotationError(pose, error, velocity, plus(velocity, scaled(-1.0, carried)), acceleration)


@allocation_free
def rotation_vector(error: RotationError) -> Triple:
    """Return ``e_R = n sin(theta)``."""
    return scaled(2.0 * error.quaternion.scalar, error.quaternion.vector)


@allocation_free
def write_torque(error: RotationError, acceleration: Triple, inertia: Triple, torque: Array) -> None:
    """Write the Cartesian torque ``R (J acceleration + Ω × JΩ)`` (N·m, stator frame).

    Parameters
    ----------
    error : RotationError
    acceleration : (3,) rad/s²
        Of the rotor in its own frame.
    inertia : (3,) kg·m²
        Nominal principal inertias.
    torque : (3,) array, N·m
        Result.
    """
    gyroscopic = cross(error.velocity, times(inertia, error.velocity))
    torque[0], torque[1], torque[2] = rotated(error.pose, plus(times(inertia, acceleration), gyroscopic))


@allocation_free
def pose_quaternion(q: Triple) -> Quaternion:
    """Return the quaternion of ``R_SR = Rx(alpha) Ry(beta) Rz(gamma)`` at a pose (rad)."""
    half = turns(scaled(0.5, q))
    w, x, y, z = half.ca * half.cb, half.sa * half.cb, half.ca * half.sb, half.sa * half.sb
    scalar = w * half.cg - z * half.sg
    return Quaternion(
        scalar, (x * half.cg + y * half.sg, y * half.cg - x * half.sg, z * half.cg + w * half.sg)
    )


@allocation_free
def rotor_motion(q: Triple, qdot: Triple, qddot: Triple) -> tuple[Triple, Triple]:
    """Return angular velocity (rad/s) and acceleration (rad/s²) of the rotor frame, in that frame.

    They are ``B qdot`` and ``B qddot + B' qdot`` with the rate Jacobian B of `rotor_rate_jacobian`.
    """
    at, (v1, v2, v3), (a1, a2, a3) = turns(q), qdot, qddot
    # Rates along the x and y axes of a rotor with gamma = 0, then turned by gamma.
    x, y = at.cb * v1, v2
    ax, ay = at.cb * a1 - at.sb * v2 * v1 + y * v3, a2 - x * v3
    velocity = (at.cg * x + at.sg * y, at.cg * y - at.sg * x, at.sb * v1 + v3)
    return velocity, (at.cg * ax + at.sg * ay, at.cg * ay - at.sg * ax, at.sb * a1 + a3 + at.cb * v2 * v1)


@allocation_free
def rotated(by: Quaternion, x: Triple) -> Triple:
    """Return a rotated vector."""
    across = cross(by.vector, x)
    return plus(x, scaled(2.0, plus(scaled(by.scalar, across), cross(by.vector, across))))


@allocation_free
def _product(p: Quaternion, r: Quaternion) -> Quaternion:
    """Return the quaternion of the rotation by `r`, then by `p`."""
    scalar = p.scalar * r.scalar - (
        p.vector[0] * r.vector[0] + p.vector[1] * r.vector[1] + p.vector[2] * r.vector[2]
    )
    return Quaternion(
        scalar, plus(plus(scaled(p.scalar, r.vector), scaled(r.scalar, p.vector)), cross(p.vector, r.vector))
    )


@allocation_free
def _inverse(p: Quaternion) -> Quaternion:
    return Quaternion(p.scalar, scaled(-1.0, p.vector))


@allocation_free
def cross(x: Triple, y: Triple) -> Triple:
    """Return the cross product of two vectors."""
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


@allocation_free
def plus(x: Triple, y: Triple) -> Triple:
    """Return the sum of two vectors."""
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


@allocation_free
def times(x: Triple, y: Triple) -> Triple:
    """Return the products of the entries of two vectors."""
    return x[0] * y[0], x[1] * y[1], x[2] * y[2]


@allocation_free
def scaled(factor: float, x: Triple) -> Triple:
    """Return a vector times a number."""
    return factor * x[0], factor * x[1], factor * x[2]
