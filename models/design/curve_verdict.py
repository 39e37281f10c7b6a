"""Whether a torque curve can be relied on: one computed from a geometry, or a user's own beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spheretwin.models import torque_curve
from spheretwin.models.actuator import MJCF_PATH, read_magnet_and_coil
from spheretwin.models.base.check import Check
from spheretwin.models.design import curve_fit, pole_torque, warnings
from spheretwin.models.design.curve_fit import Difference, Misfit
from spheretwin.models.torque_curve import TorqueCurve

MESH_BOUND = 5e-3
LOOKUP_BOUND = 1e-6


class Peak(NamedTuple):
    """Where a curve is largest."""

    peak_Nm_per_A: float
    peak_deg: float


class ComputedCurve(NamedTuple):
    """A curve computed from a geometry, and what is known of it."""

    curve: TorqueCurve
    csv: str
    """Text of its file, which says what it was computed from."""
    peak: Peak
    doubled_mesh: pole_torque.Convergence
    lookup_error: float
    """Distance of the compiled table from the spline, over the peak."""
    checks: list[Check]
    warnings: list[str]


class JudgedCurve(NamedTuple):
    """A curve beside the one that the geometry gives. Nothing is bounded: its owner judges the data."""

    rows: int
    peak: Peak
    leave_one_out: Misfit
    geometry: Difference
    lookup_error: float
    warnings: list[str]


def compute(mjcf: Path = MJCF_PATH, track: Callable[[range], Iterable[int]] = iter) -> ComputedCurve:
    """Compute the torque curve of a model file's poles and coils, and how sure it is.

    Parameters
    ----------
    mjcf : Path
        Model file; it may lack what is no pole and no coil.
    track : callable
        Passes on the numbers of the samples, first of the curve, then of some of them on a doubled mesh,
        and may show progress.

    Raises
    ------
    InputError
        The file cannot be read, lacks poles or coils, or magpylib is not installed.
    """
    magnet, coil = read_magnet_and_coil(mjcf)
    curve = pole_torque.compute_curve(magnet, coil, track=track)
    measured = pole_torque.convergence(curve, magnet, coil, track=track)
    lookup_error = curve_fit.lookup_error(curve)
    return ComputedCurve(
        curve=curve,
        csv=torque_curve.to_csv(curve, pole_torque.provenance(magnet, coil, measured)),
        peak=_peak(curve),
        doubled_mesh=measured,
        lookup_error=lookup_error,
        checks=[_mesh(measured), _lookup(lookup_error, shipped=mjcf.resolve() == MJCF_PATH)],
        warnings=warnings.of_model_file(mjcf, curve),
    )


def judge(
    curve: TorqueCurve, mjcf: Path = MJCF_PATH, track: Callable[[range], Iterable[int]] = iter
) -> JudgedCurve:
    """Tell how smooth a curve is, and how far it is from the geometry's.

    Parameters
    ----------
    curve : TorqueCurve
        From a bench or another program.
    mjcf, track
        As in `compute`.

    Raises
    ------
    InputError
        As in `compute`.
    """
    magnet, coil = read_magnet_and_coil(mjcf)
    missed = curve_fit.leave_one_out(curve)
    return JudgedCurve(
        rows=len(curve.phi_rad),
        peak=_peak(curve),
        leave_one_out=missed,
        geometry=curve_fit.difference(curve, magnet, coil, track=track),
        lookup_error=curve_fit.lookup_error(curve),
        warnings=warnings.of_model_file(mjcf, curve),
    )


def _peak(curve: TorqueCurve) -> Peak:
    top = int(np.argmax(np.abs(curve.torque_Nm_per_A)))
    return Peak(curve.peak_Nm_per_A, float(np.degrees(curve.phi_rad[top])))


def _mesh(measured: pole_torque.Convergence) -> Check:
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
        states=curve_fit.LOOKUP_POINTS,
        value=error,
        bound=LOOKUP_BOUND if shipped else None,
        why="a tenth of the curve's own error of 1e-5"
        if shipped
        else "the table's intervals were chosen for the shipped geometry; smaller parts need finer ones",
    )
