"""Effect of the iron behind the poles on the torque curve, by axisymmetric finite elements (scikit-fem).

``python docs/scripts/iron_hoop.py [MODEL.xml]`` prints the table of `models/README.md`; it needs the extra
``fem``.

One pole stands on a cap of iron about its own axis, a shell between two spheres with a flat seat. The hoop of
the actuator is a band: near a pole it is wider than the narrowest cap within it and narrower than a complete
shell. The scalar potential Φ, ``H = -grad Φ``, obeys ``div(µ grad Φ) = div M`` with the relative permeability
µ: the magnet acts by the charges of its front and back. On a sphere outside the magnet Φ gives harmonics, and
these the torque.

The mesh is of biquadratic elements along rays from the joint centre; the surfaces of iron and magnet are
lines of it. The iron is linear. The field of the coils in the iron, quadratic in the current, is left out.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spheretwin.models.actuator import MJCF_PATH
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.extras import missing
from spheretwin.models.design.rotor_field import linkage
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet, read_magnet_and_coil

MU0 = 4e-7 * np.pi

HOOP_INNER_RADIUS_m = 36.5e-3
"""Of the drawn hoop; its outer surface is a sphere through the rims of the poles' backs."""
PERMEABILITY = 1000.0
"""Relative, of soft iron far from saturation: assumed. From 500 to 5000 the peak changes by 1e-3."""

DEGREE = 100
OUTER = 8.0
"""Outer radius of the air over the radius of the sphere; beyond, the field is taken for a dipole's."""
HOLE_m = 1e-3
"""At the joint centre, where the rays meet."""
REGIONS = 5


class Iron(NamedTuple):
    """Cap of iron behind a pole."""

    half_angle_rad: float
    """From the axis of the pole; pi for a complete shell."""
    inner_radius_m: float = HOOP_INNER_RADIUS_m
    permeability: float = PERMEABILITY


class Shape(NamedTuple):
    """Surfaces of the mesh, as radii over the angle from the axis, and the charges on them."""

    inner: Any
    outer: Any
    front: Any
    sphere_m: float
    corners_rad: tuple[float, ...]
    """Angles at which a surface has a corner, or a charge ends."""
    charge: Any
    """(angle, normal along the axis) -> M·n on (outer, front), over M."""


def torque_curve(
    magnet: Magnet, coil: CoilGeometry, iron: Iron | None, phi_rad: Array, elements: int = 24
) -> Array:
    """Return f_t of a pole with a cap of iron behind it, N·m/A.

    Parameters
    ----------
    magnet : Magnet
    coil : CoilGeometry
    iron : Iron
        None: no iron, on the same mesh.
    phi_rad : (n,) array, rad
        Angles between the axes of pole and coil.
    elements : int
        Elements across the front of the magnet; the mesh is graded from there.

    Raises
    ------
    InputError
        scikit-fem is not installed.
    """
    from scipy.special import legendre_p_all

    shape = shape_of(magnet, coil.distance_m - coil.length_m / 2)
    potential = harmonics(shape, iron, magnet.remanence_T / MU0, elements)
    degrees = np.arange(len(potential))
    radial = MU0 * (degrees + 1) / shape.sphere_m * potential  # T, of P_l
    slopes = legendre_p_all(len(potential) - 1, np.cos(phi_rad), diff_n=1)[1]  # by the cosine
    linked = linkage(coil, shape.sphere_m, len(potential) - 1) * radial
    return np.asarray(np.sin(phi_rad) * (linked @ slopes))


def shape_of(magnet: Magnet, sphere_m: float) -> Shape:
    """Return the surfaces of a magnet on iron: its flat back, its front, and spheres through their rims."""
    back, rim = np.arctan2(magnet.radius_m, magnet.back_m), np.arctan2(magnet.radius_m, magnet.rim_m)
    back_rim, front_rim = (np.hypot(magnet.radius_m, height) for height in (magnet.back_m, magnet.rim_m))

    def outer(psi: Array) -> Array:
        return np.where(psi < back, magnet.back_m / np.cos(np.minimum(psi, back)), back_rim)

    def front(psi: Array) -> Array:
        inside, r = np.minimum(psi, rim), np.full_like(psi, magnet.front_m)
        for _ in range(60):  # contracts by the slope of the front, below 0.3
            sagitta = [magnet.sagitta_at_m(rho) for rho in (r * np.sin(inside)).ravel()]
            r = (magnet.front_m - np.reshape(sagitta, r.shape)) / np.cos(inside)
        return np.where(psi < rim, r, front_rim)

    def charge(psi: Array, normal: Array) -> tuple[Array, Array]:
        return np.where(psi < back, -normal, 0.0), np.where(psi < rim, normal, 0.0)

    return Shape(
        lambda psi: np.full_like(psi, HOOP_INNER_RADIUS_m), outer, front, sphere_m, (back, rim), charge
    )


def harmonics(shape: Shape, iron: Iron | None, magnetisation_A_m: float, elements: int) -> Array:
    """Return the Legendre coefficients of the potential on the sphere of a shape, (DEGREE + 1,), A.

    Raises
    ------
    InputError
        scikit-fem is not installed.
    """
    try:
        import skfem
    except ImportError:
        raise missing("magnetics", "scikit-fem", "fem", "for finite elements") from None
    if iron:
        shape = shape._replace(inner=lambda psi: np.full_like(psi, iron.inner_radius_m))
    corners = [0.0, *shape.corners_rad, iron.half_angle_rad if iron else np.pi, np.pi]
    angles = _graded(np.unique(np.round(corners, 9)).tolist(), elements)
    layers = np.linspace(0, REGIONS, REGIONS * elements + 1)
    plane = skfem.MeshQuad2.from_mesh(skfem.MeshQuad.init_tensor(angles, layers))
    psi, layer = plane.doflocs
    mesh = skfem.MeshQuad2(_mapped(shape, psi, layer), plane.t)
    element = skfem.ElementQuad2()
    basis = skfem.Basis(mesh, element, intorder=6)
    middle = plane.p[:, plane.t].mean(axis=1)
    is_iron = (middle[1] > 1) & (middle[1] < 2) & (middle[0] < (iron.half_angle_rad if iron else -1))
    relative = np.where(is_iron, iron.permeability if iron else 1.0, 1.0)[:, None]

    def stiffness(u: Any, v: Any, w: Any) -> Any:
        return relative * w.x[0] * (u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1])

    def dipole(u: Any, v: Any, w: Any) -> Any:
        return 2 / np.hypot(w.x[0], w.x[1]) * w.x[0] * u * v

    facets = plane.p[:, plane.facets].mean(axis=1)
    outside = np.flatnonzero(np.abs(facets[1] - REGIONS) < 1e-9)
    boundary = skfem.FacetBasis(mesh, element, facets=outside)
    matrix = skfem.BilinearForm(stiffness).assemble(basis) + skfem.BilinearForm(dipole).assemble(boundary)
    load = np.zeros(basis.N)
    for surface, level in enumerate((2, 3)):
        here = np.flatnonzero((np.abs(facets[1] - level) < 1e-9) & (facets[0] < max(shape.corners_rad)))

        def charges(v: Any, w: Any, surface: int = surface) -> Any:
            outward = np.sign(w.n[0] * w.x[0] + w.n[1] * w.x[1])
            angle = np.arctan2(w.x[0], w.x[1])
            return shape.charge(angle, outward * w.n[1])[surface] * w.x[0] * v

        load += skfem.LinearForm(charges).assemble(skfem.FacetBasis(mesh, element, facets=here))
    potential = skfem.solve(matrix, magnetisation_A_m * load)
    return _legendre(basis, potential, shape.sphere_m)


def _graded(corners: list[float], elements: int) -> Array:
    """Return angles of the mesh: the given ones, and between them steps that grow away from the magnet."""
    first = corners[1] / elements
    angles = [0.0]
    for start, end in pairwise(corners):
        count = max(2, round(elements * np.log(1 + (end - start) / (first * elements + start)) / np.log(2)))
        share = np.linspace(0, 1, count + 1)[1:]
        scale = first * elements + start
        grown = scale * ((1 + (end - start) / scale) ** share - 1)
        angles += (start + grown).tolist()
    return np.array(angles)


def _mapped(shape: Shape, psi: Array, layer: Array) -> Array:
    """Return the places (rho, z) of points of the plane of angle and layer."""
    surfaces = np.stack(
        [
            np.full_like(psi, HOLE_m),
            shape.inner(psi),
            shape.outer(psi),
            shape.front(psi),
            np.full_like(psi, shape.sphere_m),
            np.full_like(psi, OUTER * shape.sphere_m),
        ]
    )
    region = np.minimum(layer.astype(int), REGIONS - 1)
    low, high = (np.take_along_axis(surfaces, (region + step)[None], axis=0)[0] for step in (0, 1))
    r = low * (high / low) ** (layer - region)
    return np.stack([r * np.sin(psi), r * np.cos(psi)])


def _legendre(basis: Any, potential: Array, sphere_m: float) -> Array:
    """Return the Legendre coefficients of a potential on a sphere."""
    nodes, weights = np.polynomial.legendre.leggauss(4 * DEGREE)
    places = basis.doflocs
    here = np.flatnonzero(np.abs(np.hypot(*places) - sphere_m) < 1e-9 * sphere_m)
    angle = np.arctan2(places[0, here], places[1, here])
    order = np.argsort(angle)
    from scipy.interpolate import CubicSpline
    from scipy.special import legendre_p_all

    smooth = CubicSpline(angle[order], potential[here][order], bc_type=((1, 0.0), (1, 0.0)))
    values = smooth(np.arccos(nodes))
    P = legendre_p_all(DEGREE, nodes)[0]
    return np.asarray((np.arange(DEGREE + 1) + 0.5) * (P @ (weights * values)))


class Effect(NamedTuple):
    """Torque with a cap of iron over that without."""

    half_angle_deg: float
    peak: float
    mean: float
    """Of the magnitudes at the angles at which the coil is in front of the plane of the back."""
    mesh: float
    """Change of the peak by half the elements."""


HALF_ANGLES_DEG = (11.0, 20.0, 29.0, 47.0, 180.0)
"""The drawn hoop ends 11 degrees beyond the axis of a pole on one side and 47 degrees on the other."""
MEAN_TO_DEG = 27.0
ELEMENTS = 24


def effect(magnet: Magnet, coil: CoilGeometry, half_angle_deg: float, elements: int | None = None) -> Effect:
    """Return the effect of a cap of iron on the torque curve.

    Parameters
    ----------
    magnet, coil, half_angle_deg
        Pole, coil, and angle from the axis of the pole to the edge of the iron.
    elements : int
        As in `torque_curve`, even; `ELEMENTS` unless given.
    """
    elements = elements or ELEMENTS
    phi = np.radians(np.arange(0.25, 40.0, 0.25))
    iron, means = Iron(np.radians(half_angle_deg)), phi < np.radians(MEAN_TO_DEG)
    peaks = []
    for count in (elements // 2, elements):
        bare, with_iron = (torque_curve(magnet, coil, cap, phi, count) for cap in (None, iron))
        peaks.append(float(_peak(with_iron) / _peak(bare)))
    mean = float(np.abs(with_iron[means]).mean() / np.abs(bare[means]).mean())
    return Effect(half_angle_deg, peaks[1], mean, abs(peaks[1] - peaks[0]))


def _peak(curve: Array) -> float:
    """Return the top of the parabola through the largest sample and its neighbours."""
    top = int(np.argmax(curve))
    before, at, after = curve[top - 1 : top + 2]
    return float(at + (after - before) ** 2 / (8 * (2 * at - before - after)))


def main(mjcf: Path = MJCF_PATH) -> None:
    """Print the effect of each cap of iron on the torque curve of a model file."""
    magnet, coil = read_magnet_and_coil(mjcf)
    print("| half angle of the iron | peak | mean to 27° | mesh |\n|---|---|---|---|")
    for half_angle_deg in HALF_ANGLES_DEG:
        row = effect(magnet, coil, half_angle_deg)
        print(f"| {half_angle_deg:g}° | {row.peak:.3f} | {row.mean:.3f} | {row.mesh:.0e} |", flush=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
