"""Torque field of any arrangement of magnets, from the field that magpylib gives on one sphere around them.

Outside the magnets the radial field is a sum of harmonics ``b_lm (a / r)^(l + 2) Y_lm``. A coil of revolution
whose axis n passes through the joint centre links the flux ``sum b_lm w_l Y_lm(n)``: each turn is the edge of
a spherical cap, over which a harmonic of degree l integrates to its value at n times a factor (Funk and
Hecke). The torque of one ampere on the rotor is ``-n x grad`` of that flux, which is exact for harmonics.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import polarities
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.checks import Check
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.extras import missing
from spheretwin.models.curve_origin import of_coil
from spheretwin.models.design.direct_summation import Rule, conductors, cylinders, torque_on_coils
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet, front_radius, read_coil
from spheretwin.models.mjcf import read
from spheretwin.models.mjcf_reader import check_bounded, number, sites
from spheretwin.models.torque_curve import head
from spheretwin.models.torque_field import TorqueField, directions, to_csv

DEGREE = 150
"""Largest degree: of the shipped actuator the degrees above give 1e-5 of the peak."""
STACKED = 24
"""Cylinders that stand for a ground magnet: within 2e-4 of the peak."""
MARGIN = 1.04
"""Radius of the sphere over that of the magnets. Of the degree 2 N - l, the samples count as l what is left
at that power of 1 / MARGIN."""
LATITUDES = 1.5
"""Latitudes N of the samples over the degree."""
WINDING = Rule(24, 32, 1)

CHECKED, CHECK_RULE, CHECK_BOUND = 6, Rule(8, 8, 32), 1e-3


class ComputedField(NamedTuple):
    """Torque field of a model file, and what is known of its errors."""

    field: TorqueField
    csv: str
    degree_share: float
    """Largest torque of the upper quarter of the degrees, over the peak."""
    checks: list[Check]


def compute(
    mjcf: Path,
    step_deg: float = 1.0,
    degree: int = DEGREE,
    on_iron: bool = False,
    track: Callable[[range], Iterable[int]] = iter,
) -> ComputedField:
    """Compute the torque field of the magnets of a model file.

    Parameters
    ----------
    mjcf : Path
        Its sites ``pole_…`` are the magnets: cylinders, boxes and spheres in any pose, magnetised along their
        z axis with the sign of their user value. Its coils have one geometry.
    step_deg : float
        Step of the samples, a divisor of 180.
    degree : int
        Largest degree of the harmonics.
    on_iron : bool
        True if the back of each magnet is on an infinite plane of iron, which adds its mirror image.
    track : callable
        Iterates over the numbers of the latitudes, and may show progress.

    Raises
    ------
    InputError
        magpylib is not installed, or the magnets reach the coils.
    """
    model = read(mjcf).described
    check_bounded(model)
    coil, magnets = read_coil(model), rotor_magnets(model, on_iron)
    reach, face = reach_m(model), coil.distance_m - coil.length_m / 2
    if reach >= face:
        raise InputError(
            f"model: expected magnets within the faces of the coils at {face:g} m, received {reach:g} m"
        )
    latitudes = round(180 / step_deg) + 1
    grid = directions(latitudes, 2 * (latitudes - 1))
    harmonics = radial_harmonics(magnets, MARGIN * reach, degree, track)
    linked = linkage(coil, MARGIN * reach, degree)[:, None] * harmonics
    samples = torque_of(linked, grid)
    upper = np.where(np.arange(degree + 1)[:, None] > 0.75 * degree, linked, 0.0)
    field = TorqueField(samples, of_coil(coil), "torque field")
    share = float(np.abs(torque_of(upper, grid)).max()) / field.peak_Nm_per_A
    check = _against_forces(field, magnets, coil)
    remake = f"spheretwin magnetics field --step {step_deg:g} --degree {degree}{' --on-iron' * on_iron}"
    lines = _provenance(mjcf, coil, degree, share, check, remake)
    return ComputedField(field, to_csv(field, lines), share, [check])


def rotor_magnets(model: mujoco.MjModel, on_iron: bool = False) -> Any:
    """Return the magnets of a model as a collection of magpylib, in the rotor frame.

    Raises
    ------
    InputError
        magpylib is not installed, or a site has another shape.
    """
    try:
        from magpylib import Collection
        from magpylib.magnet import Cuboid, Cylinder, Sphere
    except ImportError:
        raise missing("magnetics", "magpylib", "magnetics", "to compute fields") from None
    from scipy.spatial.transform import Rotation

    poles, shapes = sites(model, "pole_"), mujoco.mjtGeom
    remanence_T, sources = number(model, "magnet_remanence_T"), []
    for pole, polarity in zip(poles, polarities(model, poles), strict=True):
        turned = Rotation.from_quat(model.site_quat[pole], scalar_first=True)
        axis, size, kind = turned.as_matrix()[:, 2], model.site_size[pole], model.site_type[pole]
        # Heights are along the axis of the magnet, from its middle.
        if kind == shapes.mjGEOM_CYLINDER:
            blank = Magnet(remanence_T, size[0], 2 * size[1], 0.0, front_radius(model, size[0], 2 * size[1]))
            parts = [((2 * r, top - low), 0.5 * (top + low)) for r, low, top in cylinders(blank, STACKED)]
            back, source = -size[1], Cylinder
        elif kind == shapes.mjGEOM_BOX:
            parts, back, source = [(tuple(2 * size), 0.0)], -size[2], Cuboid
        elif kind == shapes.mjGEOM_SPHERE:
            parts, back, source = [(2 * size[0], 0.0)], -size[0], Sphere
        else:
            name = model.site(pole).name
            raise InputError(f"model: expected {name} as a cylinder, box or sphere, received another shape")
        parts += [(dimension, 2 * back - height) for dimension, height in parts] if on_iron else []
        for dimension, height in parts:
            shape = {"diameter": dimension} if source is Sphere else {"dimension": dimension}
            sources.append(
                source(
                    polarization=(0.0, 0.0, polarity * remanence_T),
                    position=model.site_pos[pole] + height * axis,
                    orientation=turned,
                    **shape,
                )
            )
    return Collection(sources)


def reach_m(model: mujoco.MjModel) -> float:
    """Return the radius of a sphere about the joint centre that holds all magnets, m."""
    poles, radii = sites(model, "pole_"), []
    for pole in poles:
        size, kind = model.site_size[pole], model.site_type[pole]
        if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            R = np.empty(9)
            mujoco.mju_quat2Mat(R, model.site_quat[pole])
            centre, axis = model.site_pos[pole], R.reshape(3, 3)[:, 2]
            along = centre @ axis
            across = float(np.linalg.norm(centre - along * axis)) + size[0]
            front = Magnet(1.0, size[0], 2 * size[1], along, front_radius(model, size[0], 2 * size[1]))
            rim = np.hypot(max(abs(front.rim_m), abs(front.back_m)), across)
            radii.append(max(rim, front.reach_m if across == size[0] else rim))
        else:
            extent = np.linalg.norm(size) if kind == mujoco.mjtGeom.mjGEOM_BOX else size[0]
            radii.append(np.linalg.norm(model.site_pos[pole]) + extent)
    return float(max(radii))


def radial_harmonics(
    magnets: Any, radius_m: float, degree: int, track: Callable[[range], Iterable[int]] = iter
) -> NDArray[np.complex128]:
    """Return the coefficients b of the radial field on a sphere, (degree + 1, 2 degree + 1), T.

    The samples are at Gauss-Legendre latitudes and equal steps around. Column m holds the order m, and a
    negative index a negative order.
    """
    latitudes = round(LATITUDES * degree) + 1
    nodes, weights = np.polynomial.legendre.leggauss(latitudes)
    longitudes = 2 * latitudes
    phi, sine = 2 * np.pi * np.arange(longitudes) / longitudes, np.sqrt(1 - nodes**2)
    axes = np.stack(
        [np.outer(sine, np.cos(phi)), np.outer(sine, np.sin(phi)), np.repeat(nodes[:, None], longitudes, 1)],
        axis=2,
    )
    rows = (axes[i] for i in track(range(latitudes)))
    radial = np.stack([np.sum(magnets.getB(radius_m * row) * row, axis=1) for row in rows])
    orders = np.r_[0 : degree + 1, -degree:0]
    spectrum = np.fft.fft(radial, axis=1)[:, orders] * (2 * np.pi / longitudes)  # (latitudes, orders)
    return np.einsum("i,lmi,im->lm", weights, _legendre(degree, nodes), spectrum, optimize=True)


def linkage(coil: CoilGeometry, radius_m: float, degree: int) -> Array:
    """Return the flux linked with a coil per harmonic of the radial field on a sphere, (degree + 1,), m².

    Parameters
    ----------
    coil : CoilGeometry
    radius_m : float, m
        Of the sphere on which the radial field is given, with all magnets inside.
    degree : int
    """
    from scipy.special import legendre_p_all

    position, element = conductors(coil, WINDING)  # one element for each ring of the section
    rho, z = np.hypot(position[:, 0], position[:, 1]), position[:, 2]
    turns, r = np.linalg.norm(element, axis=1) / (2 * np.pi * rho), np.hypot(rho, z)
    P = legendre_p_all(degree + 1, z / r)[0]  # (degree + 2, rings)
    degrees = np.arange(degree + 1)[:, None]
    below = np.concatenate([np.ones((1, len(r))), P[:-2]])
    caps = 2 * np.pi * r**2 * (below - P[1:]) / (2 * degrees + 1)
    return np.asarray(np.sum(turns * caps * (radius_m / r) ** (degrees + 2), axis=1))


def torque_of(linked: NDArray[np.complex128], axes: Array) -> Array:
    """Return ``-n x grad`` of a flux at directions of a grid, (t, p, 3), N·m/A.

    The operator of angular momentum gives the coefficients of each component: no division by a sine.
    """
    degree = len(linked) - 1
    orders, degrees = np.r_[0 : degree + 1, -degree:0], np.arange(degree + 1)[:, None]
    squares = degrees * (degrees + 1)
    raised = np.sqrt(np.maximum(squares - orders * (orders + 1), 0)) * linked  # to the order above
    lowered = np.sqrt(np.maximum(squares - orders * (orders - 1), 0)) * linked
    up, down = np.roll(raised, 1, axis=1), np.roll(lowered, -1, axis=1)
    P = _legendre(degree, axes[:, 0, 2])
    meridians = axes.shape[1]
    torque = np.empty(axes.shape)
    for i, coefficients in enumerate((0.5 * (up + down), -0.5j * (up - down), orders * linked)):
        along = np.einsum("lm,lmi->im", coefficients, P)  # (t, orders)
        spectrum = np.zeros((len(axes), meridians), complex)
        for place, column in zip(orders % meridians, along.T, strict=True):
            spectrum[:, place] += column
        torque[:, :, i] = np.real(-1j * meridians * np.fft.ifft(spectrum, axis=1))
    return torque


def _legendre(degree: int, cosines: Array) -> Array:
    """Return normalised associated Legendre functions, (degree + 1, 2 degree + 1, n)."""
    from scipy.special import sph_harm_y_all

    return np.asarray(sph_harm_y_all(degree, degree, np.arccos(np.clip(cosines, -1, 1)), 0.0).real)


def _against_forces(field: TorqueField, magnets: Any, coil: CoilGeometry) -> Check:
    """Compare the field with the forces of the magnets on the conductors, in some directions."""
    axes = np.random.default_rng(0).normal(size=(CHECKED, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    forces = -torque_on_coils(magnets, axes, np.zeros(CHECKED), coil, CHECK_RULE)
    return Check(
        name="forces",
        compares="torque field against the forces of the magnets on all conductors, over the peak",
        states=CHECKED,
        value=float(np.abs(field.torque(axes) - forces).max()) / field.peak_Nm_per_A,
        bound=CHECK_BOUND,
        why="the forces are summed over 2048 points of a winding, near magnets within 2e-4; the spline of"
        " samples 1 degree apart misses 3e-5",
        unit="1",
    )


def _provenance(
    mjcf: Path, coil: CoilGeometry, degree: int, share: float, check: Check, remake: str
) -> list[str]:
    import magpylib

    return [
        "Torque field: torque on the rotor, rotor frame, of one ampere in a coil, against the direction of",
        f"its axis. Magnets: sites pole_… of {mjcf.name}.",
        *head(of_coil(coil), {}),
        f"Method: radial field on a sphere (magpylib {magpylib.__version__}), harmonics to degree {degree};",
        f"their upper quarter gives {share:.0e} of the peak. The forces on the conductors differ by"
        f" {check.value:.0e} of it.",
        f"Remake: {remake}",
    ]
