"""Validation of a twin on a log: residuals by hinge, pose and rate, and what would explain the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from spheretwin.machine.intervals import Uncertainty
from spheretwin.machine.log import Log
from spheretwin.machine.parameters import Machine, selected
from spheretwin.machine.row_order import align_rows
from spheretwin.machine.state_estimation import HINGE_NAMES
from spheretwin.machine.windows import Shooting, Window, windows_of

Array = NDArray[np.float64]

SUSPECTS = (
    "torque_scale",
    "plant.modelling_error",
    "plant.coulomb_Nm",
    "plant.viscous_Nm_s",
    "plant.modelling_torque_Nm",
    "plant.cable.stiffness_Nm_rad",
    "plant.payload_kg",
    "plant.group_gain",
    "sensors.angle_offset_rad",
)
"""Parameters of which each is tested alone for what the residuals show of it.

The delay is not among them: `fit_noise` tells it from noise of the torque.
"""

BINS = 6

# Of the mean square of all residuals over that of the noise.
CHI2 = (0.9, 1.1)

# Probability that any number is reported by chance.
_BY_CHANCE = 0.01


class Structure(NamedTuple):
    """Part of the residuals that noise does not explain."""

    what: str
    size: float
    """Change of the parameter that explains most, or mean residual in rad."""
    unit: str
    deviations: float
    """Distance from 0 in standard deviations."""


class Bin(NamedTuple):
    """Residuals of one hinge in a range of its angle, or of its rate."""

    hinge: str
    by: str
    """``angle_rad`` or ``rate_rad_s``."""
    low: float
    high: float
    rows: int
    mean_rad: float
    """Measured minus computed."""
    rms_rad: float


class Validation(NamedTuple):
    """Result of `validate`."""

    accepted: bool
    chi2: float
    """Mean square of the residuals over that of the noise of the sensors."""
    hinge_chi2: dict[str, float]
    bins: tuple[Bin, ...]
    structure: tuple[Structure, ...]
    """The most distant from 0 first; empty if noise explains all."""


def validate(
    log: Log,
    scenario: str,
    changes: Mapping[str, Any] | None = None,
    window_s: float = 0.2,
    uncertainty: Uncertainty | None = None,
) -> Validation:
    """Judge a twin by a log that has not identified it.

    Parameters
    ----------
    log : Log
    scenario : str
        Name or file of the scenario of the machine.
    changes : mapping, optional
        Its fields, such as those of a twin.
    window_s : float
        Length of the windows, each with a free start.
    uncertainty : Uncertainty, optional
        Of the identified parameters. What errors of these explain is no structure.

    Raises
    ------
    InputError
        The scenario cannot be used, or the log does not fit it.
    """
    machine = Machine(scenario, {**(changes or {}), **log.conditions})
    suspects = selected(SUSPECTS, machine.model.actuator)
    identified = selected(uncertainty.names, machine.model.actuator) if uncertainty else []
    varied = [*suspects, *(one for one in identified if one not in suspects)]
    windows = windows_of(align_rows(log), machine, window_s)
    shooting = Shooting(windows, varied)
    values = np.array([machine.nominal(parameter) for parameter in varied])
    parts = shooting.parts(values, slopes=True)
    residuals = np.concatenate([part.residual for part in parts])
    used = sum(part.used for part in parts)
    chi2 = sum(part.squares for part in parts) / used
    measured, deviation = (np.concatenate(column) for column in zip(*shooting.observed, strict=True))
    valid = np.isfinite(measured)
    # Of each hinge, less angle and rate of each free start.
    hinge_chi2 = np.sum(residuals**2, axis=0) / np.maximum(valid.sum(axis=0) - 2 * len(windows), 1)
    gradient = -np.sum([part.gradient for part in parts], axis=0)[: len(suspects)]
    full = np.sum([part.information for part in parts], axis=0)
    information = np.diag(full)[: len(suspects)]
    variance = information * max(chi2, 1.0)
    if uncertainty:
        shared = full[: len(suspects), [varied.index(one) for one in identified]]
        variance = variance + np.einsum("ij,jk,ik->i", shared, uncertainty.covariance, shared)
    limit = norm.isf(_BY_CHANCE / 2 / len(suspects))
    known = information > 0
    deviations = np.where(known, gradient / np.sqrt(np.where(known, variance, 1.0)), 0.0)
    structure = sorted(
        (
            Structure(one.name, float(gradient[i] / information[i]), one.kind.unit, float(deviations[i]))
            for i, one in enumerate(suspects)
            if abs(deviations[i]) > limit
        ),
        key=lambda one: -abs(one.deviations),
    )
    bins = tuple(_bins(residuals * deviation, measured, windows))
    return Validation(
        accepted=CHI2[0] <= chi2 <= CHI2[1] and not structure,
        chi2=float(chi2),
        hinge_chi2=dict(zip(HINGE_NAMES, map(float, hinge_chi2), strict=True)),
        bins=bins,
        structure=tuple(structure),
    )


def _bins(residual_rad: Array, angle_rad: Array, windows: Sequence[Window]) -> list[Bin]:
    """Return the residuals over angle and rate of each hinge."""
    rates = np.concatenate([window.rate_rad_s for window in windows])
    bins = []
    for hinge, name in enumerate(HINGE_NAMES):
        for by, values in (("angle_rad", angle_rad[:, hinge]), ("rate_rad_s", rates[:, hinge])):
            valid = np.isfinite(angle_rad[:, hinge])
            if not valid.any() or np.ptp(values[valid]) == 0:
                continue
            edges = np.linspace(values[valid].min(), values[valid].max(), BINS + 1)
            place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, BINS - 1)
            for number in range(BINS):
                chosen = residual_rad[valid & (place == number), hinge]
                if len(chosen):
                    mean, rms = float(chosen.mean()), float(np.sqrt(np.mean(chosen**2)))
                    low, high = float(edges[number]), float(edges[number + 1])
                    bins.append(Bin(name, by, low, high, len(chosen), mean, rms))
    return bins
