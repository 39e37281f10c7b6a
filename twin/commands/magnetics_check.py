"""``spheretwin magnetics check``: the torque matrix against the field of all poles on all windings."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models import actuator as actuators
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.check import Check
from spheretwin.models.base.errors import InputError
from spheretwin.models.design import curve_fit, field_check
from spheretwin.models.design import warnings as magnetics_warnings
from spheretwin.models.design.field_check import Comparison, Errors
from spheretwin.models.design.pole_torque import compute_curve
from spheretwin.twin.commands.reporting import kept, print_json, tracked, warn
from spheretwin.viz.terminal import magnetic_tables

BANDS_DEG = (0.0, 12.0, 24.0, 36.0, 48.0, 57.0)

TORQUE_BOUND = 0.01
QUADRATURE_BOUND = 5e-3

# Halfway between samples of the shipped curve, where its spline is least sure, and where f_t is large.
BETWEEN_SAMPLES_DEG = np.arange(0.125, 30.0, 1.25)


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the part; True when every bound is kept."""
    if rest:
        raise InputError(
            f"command line: expected --csv, --mjcf, --poses, --seed or --json, received {' '.join(rest)}"
        )
    actuator = actuators.load(options.mjcf, options.csv)
    warnings = magnetics_warnings.of_geometry(actuator)
    warn(warnings)
    tilt_rad = np.radians(_tilts_deg(options.poses, options.seed))
    compared = field_check.compare(actuator, tilt_rad, options.seed, track=tracked("direct sums"))
    errors = field_check.errors(compared, actuator.group.current_limit_A, seed=options.seed)
    curve_error = _curve_error(actuator)
    checks = _checks(errors)
    figures: dict[str, Any] = {
        "largest_torque_Nm": float(errors.torque_Nm.max()),
        "by_tilt": _by_tilt(compared, errors),
        "sources": {
            "quadrature_of_largest_torque": checks[1].value,
            "curve_between_samples_of_peak": curve_error,
            "lookup_of_peak": curve_fit.lookup_error(actuator.torque_curve),
        },
        "checks": [check.row() for check in checks],
        "warnings": warnings,
    }
    if options.json:
        print_json(figures)
    else:
        magnetic_tables.print_field_check(figures)
        magnetic_tables.print_checks(figures["checks"])
    if not checks[0].ok and curve_error > TORQUE_BOUND:
        print(
            f"spheretwin: warning: the torque curve is {100 * curve_error:.2g} % of its peak away from the"
            " model file's geometry: `spheretwin magnetics curve` remakes it",
            file=sys.stderr,
        )
    return kept("magnetics check", checks)


def _tilts_deg(poses: int, seed: int) -> NDArray[np.float64]:
    """One random tilt after the other from each band in turn, so that few poses cover all bands."""
    band = np.arange(poses) % (len(BANDS_DEG) - 1)
    low, high = np.array(BANDS_DEG)[band], np.array(BANDS_DEG)[band + 1]
    return np.asarray(np.random.default_rng([seed, 2]).uniform(low, high))


def _curve_error(actuator: Actuator) -> float:
    """Distance of the curve's spline from the geometry's f_t, between samples, over the curve's peak."""
    phi = np.radians(BETWEEN_SAMPLES_DEG)
    exact = compute_curve(actuator.magnet, actuator.coil, phi).torque_Nm_per_A
    curve = actuator.torque_curve
    return float(np.max(np.abs(curve.spline(phi) - exact)) / curve.peak_Nm_per_A)


def _by_tilt(compared: Comparison, errors: Errors) -> list[dict[str, Any]]:
    band = np.digitize(np.degrees(compared.tilt_rad), BANDS_DEG[1:-1])
    largest = errors.torque_Nm.max()
    rows = []
    for i in np.unique(band):
        torque, model, quadrature = (each[band == i] for each in errors)
        rows.append(
            {
                "tilt_deg": [BANDS_DEG[i], BANDS_DEG[i + 1]],
                "poses": len(torque),
                "median_relative_error": float(np.median(model / torque)),
                "largest_relative_error": float(np.max(model / torque)),
                "largest_error_of_largest_torque": float(model.max() / largest),
                "quadrature_of_largest_torque": float(quadrature.max() / largest),
            }
        )
    return rows


def _checks(errors: Errors) -> list[Check]:
    largest, states = errors.torque_Nm.max(), errors.torque_Nm.size
    return [
        Check(
            name="torque",
            compares="torque by the curve against the direct sum, over the largest torque",
            states=states,
            value=float(errors.model_Nm.max() / largest),
            bound=TORQUE_BOUND,
            why="superposition is exact here, so only arithmetic is left: far less than the percent to which"
            " a magnet's remanence and a coil's turns are known",
        ),
        Check(
            name="quadrature",
            compares="direct sum with half the points in each direction, over the largest torque",
            states=states,
            value=float(errors.quadrature_Nm.max() / largest),
            bound=QUADRATURE_BOUND,
            why="half the bound above: the sum that judges must be surer than what it judges",
        ),
    ]
