"""Checks of a torque curve: smoothness, look-up error and agreement with the geometry."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spheretwin.models import torque_curve
from spheretwin.models.actuator import MJCF_PATH
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.checks import Check
from spheretwin.models.design import geometry_check, pole_torque
from spheretwin.models.design.pole_torque import Mesh, compute_curve
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet, read_magnet_and_coil
from spheretwin.models.magnetics import lookup_table, place
from spheretwin.models.torque_curve import TorqueCurve

# Angles at which the look-up table is compared with the spline: 64 or more in each of its intervals.
LOOKUP_POINTS = 50_001

# Largest number of samples compared with the curve of the geometry: 23 ms each, 16 ms for a flat pole.
COMPARED = 181


class Misfit(NamedTuple):
    """Differences over all samples, in units of a peak."""

    rms: float
    worst: float
    worst_deg: float
    """Angle of the largest difference."""


class CurveDifference(NamedTuple):
    """Difference of samples and the curve computed from a geometry, in units of the computed peak."""

    as_given: Misfit
    scale: float
    """Factor of the computed curve with the least squared difference from the samples."""
    scaled: Misfit
    """Remaining difference with that factor: a difference in shape."""


def leave_one_out(curve: TorqueCurve) -> Misfit:
    """Return the error of the spline through the other samples at each left-out inner sample.

    It shows noise, and samples that are too far apart. It overestimates the error of the curve itself, whose
    gaps are half as wide.

    Parameters
    ----------
    curve : TorqueCurve
        Samples.

    Returns
    -------
    Misfit
        In units of the curve's peak.
    """
    inner = range(1, len(curve.phi_rad) - 1)
    missed = np.array([_without(curve, i).spline(curve.phi_rad[i]) for i in inner])
    return _misfit(missed - curve.torque_Nm_per_A[1:-1], curve.phi_rad[1:-1], curve.peak_Nm_per_A)


def largest_lookup_error(curve: TorqueCurve) -> float:
    """Return the largest distance of the compiled look-up table from the spline, in units of the peak.

    The table combines a coil and its opposite (see `models.magnetics`), and so does this figure.

    Parameters
    ----------
    curve : TorqueCurve
        Samples.
    """
    phi = np.linspace(1e-6, np.pi - 1e-6, LOOKUP_POINTS)
    table = lookup_table(curve)
    row = np.array([place(cosine) for cosine in np.cos(phi)])
    index = row.astype(np.int64)
    h = np.polynomial.polynomial.polyval(row - index, table[index].T, tensor=False)
    pair = curve.spline(phi) - curve.spline(np.pi - phi)
    return float(np.max(np.abs(h * np.sin(phi) - pair)) / curve.peak_Nm_per_A)


def difference(
    curve: TorqueCurve,
    magnet: Magnet,
    coil: CoilGeometry,
    mesh: Mesh | None = None,
    track: Callable[[range], Iterable[int]] = iter,
) -> CurveDifference:
    """Compare samples with the curve computed from a geometry, at the angles of the samples.

    Parameters
    ----------
    curve : TorqueCurve
        Samples, measured or computed elsewhere.
    magnet, coil, mesh, track
        As in `pole_torque.compute_curve`.
    """
    chosen = np.unique(np.linspace(0, len(curve.phi_rad) - 1, COMPARED).round().astype(np.int64))
    phi, sample = curve.phi_rad[chosen], curve.torque_Nm_per_A[chosen]
    computed = compute_curve(magnet, coil, phi, mesh, track)
    expected, peak = computed.torque_Nm_per_A, computed.peak_Nm_per_A
    scale = float(sample @ expected / (expected @ expected))
    return CurveDifference(
        as_given=_misfit(sample - expected, phi, peak),
        scale=scale,
        scaled=_misfit(sample - scale * expected, phi, peak),
    )


def _without(curve: TorqueCurve, index: int) -> TorqueCurve:
    return TorqueCurve(np.delete(curve.phi_rad, index), np.delete(curve.torque_Nm_per_A, index))


def _misfit(distance: Array, phi_rad: Array, peak: float) -> Misfit:
    worst = int(np.argmax(np.abs(distance)))
    return Misfit(
        rms=float(np.sqrt(np.mean(distance**2)) / peak),
        worst=float(np.abs(distance[worst]) / peak),
        worst_deg=float(np.degrees(phi_rad[worst])),
    )


MESH_BOUND = 5e-3
LOOKUP_BOUND = 1e-6


class CurvePeak(NamedTuple):
    """Peak of a curve."""

    peak_Nm_per_A: float
    peak_deg: float


class ComputedCurve(NamedTuple):
    """Curve computed from a geometry, with its checks."""

    curve: TorqueCurve
    csv: str
    """Text of its file, with its provenance."""
    peak: CurvePeak
    doubled_mesh: pole_torque.MeshConvergence
    lookup_error: float
    """Distance of the compiled table from the spline, over the peak."""
    checks: list[Check]
    warnings: list[str]


class JudgedCurve(NamedTuple):
    """Curve compared with that of the geometry. There are no bounds: the user judges the data."""

    rows: int
    peak: CurvePeak
    leave_one_out: Misfit
    geometry: CurveDifference
    lookup_error: float
    warnings: list[str]


def compute(mjcf: Path = MJCF_PATH, track: Callable[[range], Iterable[int]] = iter) -> ComputedCurve:
    """Compute the torque curve of the poles and coils of a model file, and check it.

    Parameters
    ----------
    mjcf : Path
        Model file; parts other than poles and coils may be missing.
    track : callable
        Iterates over the numbers of the samples, first of the curve, then of some of them on a doubled mesh,
        and may show progress.

    Raises
    ------
    InputError
        The file cannot be read, lacks poles or coils, or magpylib is not installed.
    """
    magnet, coil = read_magnet_and_coil(mjcf)
    curve = pole_torque.compute_curve(magnet, coil, track=track)
    curve = replace(curve, distance_sensitivity=pole_torque.distance_sensitivity(curve, magnet, coil))
    measured = pole_torque.convergence(curve, magnet, coil, track=track)
    lookup_error = largest_lookup_error(curve)
    return ComputedCurve(
        curve=curve,
        csv=torque_curve.to_csv(curve, pole_torque.provenance(curve, magnet, coil, measured)),
        peak=_peak(curve),
        doubled_mesh=measured,
        lookup_error=lookup_error,
        checks=[_mesh(measured), _lookup(lookup_error, shipped=mjcf.resolve() == MJCF_PATH)],
        warnings=geometry_check.of_model_file(mjcf, curve),
    )


def judge(
    curve: TorqueCurve, mjcf: Path = MJCF_PATH, track: Callable[[range], Iterable[int]] = iter
) -> JudgedCurve:
    """Report the smoothness of a curve, and its distance from the curve of the geometry.

    Parameters
    ----------
    curve : TorqueCurve
        Measured, or from another program.
    mjcf, track
        As in `compute`.

    Raises
    ------
    InputError
        As in `compute`.
    """
    magnet, coil = read_magnet_and_coil(mjcf)
    missed = leave_one_out(curve)
    return JudgedCurve(
        rows=len(curve.phi_rad),
        peak=_peak(curve),
        leave_one_out=missed,
        geometry=difference(curve, magnet, coil, track=track),
        lookup_error=largest_lookup_error(curve),
        warnings=geometry_check.of_model_file(mjcf, curve),
    )


def _peak(curve: TorqueCurve) -> CurvePeak:
    top = int(np.argmax(np.abs(curve.torque_Nm_per_A)))
    return CurvePeak(curve.peak_Nm_per_A, float(np.degrees(curve.phi_rad[top])))


def _mesh(measured: pole_torque.MeshConvergence) -> Check:
    return Check(
        name="mesh",
        compares="peak of the curve against the one on half the mesh, over the peak",
        states=1,
        value=measured.peak,
        bound=MESH_BOUND,
        why="a real magnet's remanence is not known better than half a percent",
    )


def _lookup(error: float, shipped: bool) -> Check:
    return Check(
        name="lookup",
        compares="compiled look-up table against the spline, over the peak",
        states=LOOKUP_POINTS,
        value=error,
        bound=LOOKUP_BOUND if shipped else None,
        why="a tenth of the curve's own error of 1e-5"
        if shipped
        else "the table's intervals were chosen for the shipped geometry; smaller parts need finer ones",
    )
