"""Check of the torque matrix: the field of all poles on all windings."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check
from spheretwin.models.design import curve_check, direct_summation, geometry_check
from spheretwin.models.design.direct_summation import Comparison, Errors
from spheretwin.models.design.pole_torque import compute_curve
from spheretwin.models.scatter import Scatter, part_errors

# The last is the largest tilt of the paper's nutation.
BANDS_DEG = (0.0, 12.0, 24.0, 36.0, 48.0, 57.0)

TORQUE_BOUND = 0.01

# Largest errors of the scatter that is checked: gain, two angles in rad, distance in m.
SCATTER_BOUNDS = (0.05, 0.01, 0.01, 3e-4)
SCATTER_POSES = 3
QUADRATURE_BOUND = 5e-3

# Halfway between samples of the shipped curve, where its spline is least accurate, and where f_t is large.
BETWEEN_SAMPLES_DEG = np.arange(0.125, 30.0, 1.25)


class Band(NamedTuple):
    """Errors of the poses within a band of tilt, over all their currents."""

    tilt_deg: tuple[float, float]
    poses: int
    median_relative_error: float
    largest_relative_error: float
    largest_error_of_largest_torque: float
    quadrature_of_largest_torque: float


class Sources(NamedTuple):
    """Sources of the errors."""

    quadrature_of_largest_torque: float
    """Change of the direct sum with half the points in each direction."""
    curve_between_samples_of_peak: float
    """Distance of the curve's spline from f_t of the geometry."""
    lookup_of_peak: float
    """Distance of the compiled table from that spline."""


class FieldVerdict(NamedTuple):
    """Result of the comparison of the torque matrix with direct sums."""

    largest_torque_Nm: float
    """Of all poses and currents."""
    by_tilt: list[Band]
    sources: Sources
    checks: list[Check]
    warnings: list[str]

    @property
    def curve_is_of_another_geometry(self) -> bool:
        """True if the torque exceeds its bound and the curve alone differs as much from the geometry."""
        torque = self.checks[0]
        return not torque.ok and self.sources.curve_between_samples_of_peak > TORQUE_BOUND


def judge(
    actuator: Actuator,
    poses: int = 15,
    seed: int = 0,
    track: Callable[[range], Iterable[int]] = iter,
) -> FieldVerdict:
    """Compare G_t(q)·I with the field of every magnet on every winding.

    Parameters
    ----------
    actuator : Actuator
        Actuator with the torque curve to check.
    poses : int
        Random poses, from each of `BANDS_DEG` in turn; some seconds each.
    seed : int
        Of poses and currents.
    track : callable
        Iterates over the numbers of the poses, and may show progress.

    Raises
    ------
    InputError
        magpylib is not installed, or the actuator has a torque field.
    """
    curve, tilt_rad = actuator.torque_curve, np.radians(_tilts_deg(poses, seed))
    compared = direct_summation.compare(actuator, tilt_rad, seed, track=track)
    errors = direct_summation.errors(compared, actuator.group.current_limit_A, seed=seed)
    torque, quadrature = _torque(errors), _quadrature(errors)
    return FieldVerdict(
        largest_torque_Nm=float(errors.torque_Nm.max()),
        by_tilt=_by_tilt(compared, errors),
        sources=Sources(
            quadrature_of_largest_torque=_of_largest(errors.quadrature_Nm, errors),
            curve_between_samples_of_peak=_curve_error(actuator),
            lookup_of_peak=curve_check.largest_lookup_error(curve),
        ),
        checks=[torque, quadrature, *_scatter(actuator, seed)],
        warnings=geometry_check.of_geometry(actuator),
    )


def _scatter(actuator: Actuator, seed: int) -> list[Check]:
    """Compare the torque matrix of a machine with scatter with direct sums over its displaced parts."""
    if actuator.torque_curve.distance_sensitivity is None:
        return []
    rng = np.random.default_rng([seed, 3])
    poles, coils = (
        part_errors(rng.uniform(-1, 1, (len(axes), 4)) * SCATTER_BOUNDS)
        for axes in (actuator.pole_axes, actuator.coil_axes)
    )
    scatter = Scatter(poles, coils)
    compared = direct_summation.compare(
        actuator, np.radians(_tilts_deg(SCATTER_POSES, seed)), seed, scatter=scatter
    )
    errors = direct_summation.errors(compared, actuator.group.current_limit_A, seed=seed)
    return [
        Check(
            name="scatter",
            compares="torque of a machine with scatter against the direct sum, over the largest torque",
            states=errors.torque_Nm.size,
            value=_of_largest(errors.model_Nm, errors),
            bound=TORQUE_BOUND,
            why="mean axes and sensitivities to distance are exact to first order; the second-order rest must"
            " stay below the percent to which a machine is known",
        )
    ]


def _tilts_deg(poses: int, seed: int) -> NDArray[np.float64]:
    """Return random tilts from each band in turn, so that few poses cover all bands."""
    band = np.arange(poses) % (len(BANDS_DEG) - 1)
    low, high = np.array(BANDS_DEG)[band], np.array(BANDS_DEG)[band + 1]
    return np.asarray(np.random.default_rng([seed, 2]).uniform(low, high))


def _curve_error(actuator: Actuator) -> float:
    """Return the distance of the spline from f_t of the geometry, between samples, over the curve's peak."""
    phi = np.radians(BETWEEN_SAMPLES_DEG)
    exact = compute_curve(actuator.magnet, actuator.coil, phi).torque_Nm_per_A
    curve = actuator.torque_curve
    return float(np.max(np.abs(curve.spline(phi) - exact)) / curve.peak_Nm_per_A)


def _by_tilt(compared: Comparison, errors: Errors) -> list[Band]:
    band = np.digitize(np.degrees(compared.tilt_rad), BANDS_DEG[1:-1])
    rows = []
    for i in np.unique(band):
        here = Errors(*(values[band == i] for values in errors))
        relative = here.model_Nm / here.torque_Nm
        rows.append(
            Band(
                tilt_deg=(BANDS_DEG[i], BANDS_DEG[i + 1]),
                poses=len(here.torque_Nm),
                median_relative_error=float(np.median(relative)),
                largest_relative_error=float(np.max(relative)),
                largest_error_of_largest_torque=_of_largest(here.model_Nm, errors),
                quadrature_of_largest_torque=_of_largest(here.quadrature_Nm, errors),
            )
        )
    return rows


def _of_largest(distance_Nm: NDArray[np.float64], errors: Errors) -> float:
    return float(distance_Nm.max() / errors.torque_Nm.max())


def _torque(errors: Errors) -> Check:
    return Check(
        name="torque",
        compares="torque by the curve against the direct sum, over the largest torque",
        states=errors.torque_Nm.size,
        value=_of_largest(errors.model_Nm, errors),
        bound=TORQUE_BOUND,
        why="superposition is exact here, so only arithmetic is left: far less than the percent to which"
        " a magnet's remanence and a coil's turns are known",
    )


def _quadrature(errors: Errors) -> Check:
    return Check(
        name="quadrature",
        compares="direct sum with half the points in each direction, over the largest torque",
        states=errors.torque_Nm.size,
        value=_of_largest(errors.quadrature_Nm, errors),
        bound=QUADRATURE_BOUND,
        why="half the bound above: the reference sum must be more accurate than the torque matrix",
    )
