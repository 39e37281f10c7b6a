"""Torque curve from geometry: torque of one coil on one pole magnet, computed with magpylib.

The magnet is modelled by its equivalent current sheet ``M x n``: M = Br / mu0 ampere per metre around its
side, and on a front that is ground to a sphere M times the sine of the angle between axis and normal. The
coil is a stack of thin solenoids, one for each radius of the winding, whose field magpylib has in closed
form. The Lorentz torque on the sheet is then an integral of a continuous function over a surface. For the
reverse, the force on the winding in the magnet's field, the integrand is infinite along the magnet's sharp
rim, which passes half a millimetre from the winding, or, where the front is flat, through it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.extras import missing
from spheretwin.models.curve_origin import computed_from
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet
from spheretwin.models.torque_curve import TorqueCurve, head

# Where the rim of a flat magnet crosses the bore of the winding (8 and 14.7 degrees at the shipped sizes) the
# second derivative of f_t jumps: a cubic spline through samples 0.5 degrees apart misses 1.3e-4 of the peak
# there, 0.25 misses 4e-5. A magnet that is ground to the ball stays out of the winding: 1.0e-6 and 5.8e-8.
STEP_DEG = 0.25

# Samples between two that `convergence` computes again: 2 degrees apart.
CONVERGENCE_STRIDE = 8

# Step and angles of `distance_sensitivity`, and its mesh: four digits are sufficient.
DISTANCE_STEP_m = 2e-4
SENSITIVITY_RAD = np.radians(np.arange(0.5, 90.0))

# Points of the sheet evaluated at once: with their layers they stay in the cache of the processor (1.5 times
# as fast as 2048 points).
BLOCK = 512


class Mesh(NamedTuple):
    """Numbers of quadrature points; with the default ones f_t is within 1e-5 of its peak."""

    along: int = 24
    """Gauss points along the magnet's side, crowded towards its outer rim."""
    around: int = 256
    """Equal steps around one half of the magnet; the other half mirrors it."""
    across: int = 8
    """Gauss points across the winding on either side of the field point's own radius."""
    over: int = 24
    """Gauss points over a ground front, from its rim to its middle."""

    def doubled(self) -> Mesh:
        """Return a mesh with twice the points in each direction."""
        return Mesh(*(2 * points for points in self))


class MeshConvergence(NamedTuple):
    """Change of the curve by a doubled mesh, in units of the peak."""

    peak: float
    """Change of the largest sample."""
    worst: float
    """Largest change of the samples computed again."""


def sample_angles() -> Array:
    """Return the angles of the samples, rad: equal steps from 0 to pi."""
    return np.radians(np.linspace(0.0, 180.0, round(180.0 / STEP_DEG) + 1))


def compute_curve(
    magnet: Magnet,
    coil: CoilGeometry,
    phi_rad: Array | None = None,
    mesh: Mesh | None = None,
    track: Callable[[range], Iterable[int]] = iter,
    on_iron: bool = False,
) -> TorqueCurve:
    """Compute the torque of one ampere in a coil on one pole of polarity +1, about the joint centre.

    Parameters
    ----------
    magnet : Magnet
        Pole magnet, magnetised outward along its axis.
    coil : Coil
        Air-core coil; positive current runs counterclockwise about its outward axis.
    phi_rad : (n,) array, rad
        Angles between the two axes; `sample_angles()` unless given.
    mesh : Mesh
        Quadrature; the default one unless given.
    track : callable
        Iterates over the numbers of the angles, and may show progress.
    on_iron : bool
        True if the back of the pole is on an infinite plane of iron. This is an upper bound of the effect of
        a hoop behind the poles, at angles with the whole coil in front of that plane (for the shipped sizes
        up to 27 degrees). Beyond, the image method is invalid, and the result is not a bound. The curve then
        has no numbers of its geometry, as no model file holds such a plane.

    Returns
    -------
    TorqueCurve
        f_t in N·m/A, positive if it pulls the pole towards the coil's axis, exactly 0 at 0 and pi.

    Raises
    ------
    InputError
        magpylib is not installed, or the winding has no section.

    Notes
    -----
    On the sheet ``K = M x n`` the torque about the origin is ``∫ p x (K x B) dA``. K runs around the pole's
    axis, normal to the position p, so the integrand is ``K (p.B)``: only the coil's *radial* field, seen from
    the joint centre, turns the rotor. On side and ground front alike ``|K| dA`` is ``M rho dpsi dh``, rho
    being the distance from the axis, h the height along it.

    Iron of infinite permeability mirrors a magnet that stands on it upright: outside, the field is that of
    the magnet and its mirror image, magnetised alike, twice as long together. The effect of the coil's own
    field on the iron, quadratic in the current, is left out.

    References
    ----------
    N. Derby and S. Olbert, "Cylindrical magnets and ideal solenoids", Am. J. Phys. 78 (2010) 229-235.
    """
    if not 0 < coil.inner_radius_m < coil.outer_radius_m:
        raise InputError(
            f"coil: expected an inner radius below the outer radius of {coil.outer_radius_m:g} m,"
            f" received {coil.inner_radius_m:g} m"
        )
    phi_rad = sample_angles() if phi_rad is None else np.asarray(phi_rad, dtype=np.float64)
    solenoid = _solenoid_field()
    angles = track(range(len(phi_rad)))
    mesh = mesh or Mesh()
    sheet = _on_iron(_sheet(magnet, mesh), magnet) if on_iron else _sheet(magnet, mesh)
    torque = np.array([_torque(sheet, magnet.remanence_T, coil, phi_rad[i], mesh, solenoid) for i in angles])
    torque[(phi_rad == 0.0) | (phi_rad == np.pi)] = 0.0  # by symmetry; the sum leaves 1e-18
    return TorqueCurve(phi_rad, torque, None if on_iron else computed_from(magnet, coil))


def convergence(
    curve: TorqueCurve,
    magnet: Magnet,
    coil: CoilGeometry,
    mesh: Mesh | None = None,
    track: Callable[[range], Iterable[int]] = iter,
) -> MeshConvergence:
    """Compare a curve with one on a doubled mesh, at its peak and at every eighth sample.

    Parameters
    ----------
    curve : TorqueCurve
        Result of `compute_curve` for the same magnet, coil and mesh.
    magnet, coil, mesh, track
        As in `compute_curve`.
    """
    top = int(np.argmax(np.abs(curve.torque_Nm_per_A)))
    again = np.append(np.arange(0, len(curve.phi_rad), CONVERGENCE_STRIDE), top)
    finer = compute_curve(magnet, coil, curve.phi_rad[again], (mesh or Mesh()).doubled(), track)
    change = np.abs(finer.torque_Nm_per_A - curve.torque_Nm_per_A[again]) / curve.peak_Nm_per_A
    return MeshConvergence(peak=float(change[-1]), worst=float(np.max(change)))


def distance_sensitivity(curve: TorqueCurve, magnet: Magnet, coil: CoilGeometry) -> dict[str, float]:
    """Return the change of a curve with the distance of magnet and coil from the joint centre, 1/m.

    With ``f_t = g(c) sin phi`` and ``c = cos phi``, the derivative of g is fitted by
    ``gain g + stretch (1 - c) g'(c)``: least squares of f_t over acute angles.

    Parameters
    ----------
    curve : TorqueCurve
        Result of `compute_curve` for the same magnet and coil.
    magnet, coil
        As in `compute_curve`.

    Returns
    -------
    dict
        ``magnet gain``, ``magnet stretch``, ``coil gain``, ``coil stretch``.
    """
    phi, mesh = SENSITIVITY_RAD, Mesh(12, 64, 6, 12)
    cosine, sine = np.cos(phi), np.sin(phi)
    f, slope = curve.spline(phi), curve.spline(phi, 1)
    basis = np.column_stack([f, (1 - cosine) * (f * cosine / sine - slope) / sine])  # dc = -sin phi dphi
    sensitivity: dict[str, float] = {}
    for name in ("magnet", "coil"):
        farther, closer = (
            compute_curve(
                replace(magnet, distance_m=magnet.distance_m + (name == "magnet") * step_m),
                replace(coil, distance_m=coil.distance_m + (name == "coil") * step_m),
                phi,
                mesh,
            ).torque_Nm_per_A
            for step_m in (DISTANCE_STEP_m, -DISTANCE_STEP_m)
        )
        fit = np.linalg.lstsq(basis, (farther - closer) / (2 * DISTANCE_STEP_m), rcond=None)[0]
        sensitivity |= {f"{name} gain": float(fit[0]), f"{name} stretch": float(fit[1])}
    return sensitivity


def provenance(
    curve: TorqueCurve, magnet: Magnet, coil: CoilGeometry, measured: MeshConvergence
) -> list[str]:
    """Return lines with the provenance of a torque curve, for the head of its file.

    Parameters
    ----------
    curve : TorqueCurve
        Result of `compute_curve`, with its sensitivities to distance.
    magnet, coil
        Input of the curve.
    measured : Convergence
        Change by a doubled mesh.
    """
    import magpylib

    mesh = Mesh()
    return [
        "Torque curve f_t(phi): torque on one pole of polarity +1, of one ampere in one coil, about the",
        "joint centre, against the angle between their axes; positive where it pulls the pole to the coil.",
        f"Magnet: Br {magnet.remanence_T:g} T along its axis, radius {_mm(magnet.radius_m)},"
        f" length {_mm(magnet.length_m)}, centre at {_mm(magnet.distance_m)}, {_front(magnet)}.",
        f"Coil: {coil.turns:g} turns in air, radii {_mm(coil.inner_radius_m)} to {_mm(coil.outer_radius_m)},"
        f" length {_mm(coil.length_m)}, centre at {_mm(coil.distance_m)}.",
        *head(computed_from(magnet, coil), curve.distance_sensitivity or {}),
        "Method: torque on the magnet's equivalent current sheet in the exact field of solenoids (magpylib"
        f" {magpylib.__version__}).",
        f"Quadrature: {mesh.along} points along the side, {_over_front(magnet, mesh)}{mesh.around} on half a"
        f" circle, 2 x {mesh.across} across the winding.",
        f"Convergence: twice the points in each direction change the peak by {measured.peak:.0e} of itself",
        f"and any sample by {measured.worst:.0e} of the peak at most.",
        "Remake: spheretwin magnetics curve",
    ]


class _Sheet(NamedTuple):
    """Circles about the axis of the pole that represent its current sheet."""

    height: Array  # (n,), m, along the axis from the joint centre
    rho: Array  # (n,), m
    weight: Array  # (n,), m: share of the height


def _sheet(magnet: Magnet, mesh: Mesh) -> _Sheet:
    """Return the circles of the side from the rim inward, then those of a ground front from rim to middle."""
    along, d_along = _graded(mesh.along, power=2)
    side = magnet.rim_m - magnet.back_m  # m, of height
    height, rho, weight = (
        magnet.rim_m - side * along,
        np.full(mesh.along, magnet.radius_m),
        side * d_along,
    )
    if not magnet.front_radius_m:
        return _Sheet(height, rho, weight)
    over, d_over = _graded(mesh.over, power=2)
    rim = np.arcsin(magnet.radius_m / magnet.front_radius_m)
    angle = rim * (1.0 - over)  # (over,), at the sphere's centre, from the axis
    circle = magnet.front_radius_m * np.sin(angle)
    fallen = 2.0 * magnet.front_radius_m * np.sin(0.5 * angle) ** 2  # behind the middle of the front
    return _Sheet(
        np.append(height, magnet.front_m - fallen),
        np.append(rho, circle),
        np.append(weight, rim * d_over * circle),
    )


def _on_iron(sheet: _Sheet, magnet: Magnet) -> _Sheet:
    """Return a sheet and its mirror image in the plane of the magnet's back."""
    mirrored = _Sheet(2 * magnet.back_m - sheet.height, sheet.rho, sheet.weight)
    return _Sheet(*(np.concatenate(both) for both in zip(sheet, mirrored, strict=True)))


def _torque(
    sheet: _Sheet, remanence_T: float, coil: CoilGeometry, phi: float, mesh: Mesh, solenoid: SolenoidField
) -> float:
    """Return f_t at one angle, N·m/A; the coil's axis is z, the pole's lies in the plane of x and z."""
    psi = (np.arange(mesh.around) + 0.5) * np.pi / mesh.around  # (around,)
    side = np.outer(sheet.rho, np.cos(psi))  # (n, around), in the plane of both axes
    x = sheet.height[:, None] * np.sin(phi) + side * np.cos(phi)
    z = sheet.height[:, None] * np.cos(phi) - side * np.sin(phi)
    rho = np.hypot(x, np.outer(sheet.rho, np.sin(psi)))
    radial = _radial_field(coil, rho.ravel(), z.ravel(), mesh.across, solenoid).reshape(rho.shape)
    both_halves = 2.0 * np.pi / mesh.around
    # Br / mu0 of the sheet times mu0 of the coil's field: mu0 cancels.
    return float(-remanence_T * both_halves * (sheet.weight @ np.sum(radial * side, axis=1)))


def _radial_field(coil: CoilGeometry, rho: Array, z: Array, across: int, solenoid: SolenoidField) -> Array:
    """Return the coil field over mu0 per ampere, projected on the position from the joint centre: A/m · m.

    Parameters
    ----------
    coil : Coil
        The coil, its axis along z.
    rho, z : (n,) array, m
        Points: distance from the axis, and height above the joint centre.
    across : int
        Gauss points on either side of a point's own radius.
    solenoid : callable
        Field of a thin solenoid.
    """
    blocks = np.array_split(np.arange(len(rho)), -(-len(rho) // BLOCK))
    return np.concatenate([_radial_field_block(coil, rho[b], z[b], across, solenoid) for b in blocks])


def _radial_field_block(
    coil: CoilGeometry, rho: Array, z: Array, across: int, solenoid: SolenoidField
) -> Array:
    layers, weights = _winding_layers(coil, rho, across)
    b_rho, _, b_z = solenoid(
        (0.5 * coil.length_m / layers).ravel(),
        (rho[:, None] / layers).ravel(),
        ((z - coil.distance_m)[:, None] / layers).ravel(),
    )
    projected = rho[:, None] * b_rho.reshape(layers.shape) + z[:, None] * b_z.reshape(layers.shape)
    per_length: Array = np.sum(weights * projected, axis=1)
    return coil.turns / coil.length_m * per_length


def _winding_layers(coil: CoilGeometry, rho: Array, across: int) -> tuple[Array, Array]:
    """Return radii of the solenoids that represent the winding at each point, and their shares of the turns.

    The rule is split at the radius of the point and refined there: inside the winding the field of a layer
    jumps as the layer's radius passes the point, and near its face it has a logarithm there.

    Returns
    -------
    (n, 2 across) array, m
        Radii of the layers.
    (n, 2 across) array
        Shares, 1 in total.
    """
    near, share = _graded(across, power=3)
    split = np.clip(rho, coil.inner_radius_m, coil.outer_radius_m)[:, None]  # (n, 1)
    outer, inner = coil.outer_radius_m - split, split - coil.inner_radius_m
    layers = np.hstack([split + outer * near, split - inner * near])
    weights = np.hstack([outer * share, inner * share])
    return layers, weights / (coil.outer_radius_m - coil.inner_radius_m)


@cache
def _graded(points: int, power: int) -> tuple[Array, Array]:
    """Return a Gauss-Legendre rule on 0 to 1 with the substitution ``x = t**power``: finer near 0."""
    t, weight = np.polynomial.legendre.leggauss(points)
    t = 0.5 + 0.5 * t
    return t**power, 0.5 * weight * power * t ** (power - 1)


# (half length, rho, z), all over the radius -> (B_rho, B_phi, B_z) over mu0 times the current per length.
SolenoidField = Callable[[Array, Array, Array], Sequence[Array]]


def _solenoid_field() -> SolenoidField:
    """Return magpylib's field of an axially magnetised cylinder, which is that of a thin solenoid."""
    try:
        from magpylib.core import magnet_cylinder_axial_Bfield
    except ImportError:
        raise missing("magnetics", "magpylib", "magnetics", "to compute the torque curve") from None
    return magnet_cylinder_axial_Bfield


def _front(magnet: Magnet) -> str:
    if not magnet.front_radius_m:
        return "front flat"
    return f"front ground to radius {_mm(magnet.front_radius_m)}"


def _over_front(magnet: Magnet, mesh: Mesh) -> str:
    return f"{mesh.over} over the front, " if magnet.front_radius_m else ""


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:g} mm"
