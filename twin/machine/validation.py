"""Residuals of windows and their test: by hinge, angle, rate and time, and what would explain the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import norm

from spheretwin.machine.intervals import Uncertainty
from spheretwin.machine.log import Log
from spheretwin.machine.parameters import Machine, Parameter, priors, selected
from spheretwin.machine.row_order import align_rows
from spheretwin.machine.windows import Part, Shooting, normal_equations, windows_of
from spheretwin.models.base.arrays import Array
from spheretwin.models.mjcf_reader import HINGES

BINS = 6

CHI2 = (0.9, 1.1)
"""Mean square of all residuals over that of the noise, if the model lacks nothing."""


QUANTITIES = {"angle_rad": "angle, rad", "rate_rad_s": "rate, rad/s", "t_s": "time, s"}
"""Quantities by which residuals are sorted, and their labels."""


class ResidualBin(NamedTuple):
    """Residuals of one hinge in a range of its angle, of its rate, or of the time."""

    hinge: str
    by: str
    """One of `QUANTITIES`."""
    low: float
    high: float
    rows: int
    mean_rad: float
    """Measured minus computed."""
    rms_rad: float


class ResidualFit(NamedTuple):
    """Agreement of a machine with windows."""

    chi2: float
    """Mean square of the residuals in the noise of the sensors."""
    hinge_chi2: dict[str, float]
    """NaN for a hinge that is not informative: free starts explain whatever its sensor reports."""
    bins: tuple[ResidualBin, ...]


def fit_of(parts: Sequence[Part], shooting: Shooting) -> ResidualFit:
    """Return the agreement of windows under some parameters, which `Shooting.parts` gave."""
    windows = shooting.windows
    measured, deviation = (np.concatenate(column) for column in zip(*shooting.observed, strict=True))
    residual = np.concatenate([part.residual for part in parts])
    valid = np.isfinite(measured)
    # Of each hinge, less angle and rate of each free start.
    free = valid.sum(axis=0) - 2 * len(windows)
    hinge_chi2 = np.where(free > 0, np.sum(residual**2, axis=0) / np.maximum(free, 1), np.nan)
    residual_rad = np.where(valid, residual * deviation, np.nan)
    times = [window.log.t_s[window.first + 1 :][: window.rows, None] for window in windows]
    columns = (
        measured,
        np.concatenate([window.rate_rad_s for window in windows]),
        np.vstack(times) + [0.0] * 3,
    )
    return ResidualFit(
        sum(part.squares for part in parts) / sum(part.used for part in parts),
        dict(zip(HINGES, map(float, hinge_chi2), strict=True)),
        tuple(
            one
            for hinge, name in enumerate(HINGES)
            for by, values in zip(QUANTITIES, columns, strict=True)
            for one in _bins(name, by, values[valid[:, hinge], hinge], residual_rad[valid[:, hinge], hinge])
        ),
    )


def _bins(hinge: str, by: str, values: Array, residual_rad: Array) -> list[ResidualBin]:
    """Return the residuals of a hinge over some values."""
    if not len(values) or np.ptp(values) == 0:
        return []
    edges = np.linspace(values.min(), values.max(), BINS + 1)
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, BINS - 1)
    bins = []
    for number in np.unique(place):
        chosen = residual_rad[place == number]
        mean, rms = float(chosen.mean()), float(np.sqrt(np.mean(chosen**2)))
        low, high = float(edges[number]), float(edges[number + 1])
        bins.append(ResidualBin(hinge, by, low, high, len(chosen), mean, rms))
    return bins


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


class Validation(NamedTuple):
    """Result of `validate`."""

    accepted: bool
    fit: ResidualFit
    """Of all windows."""
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
        Of the identified parameters. What errors of these explain, or errors that data sheets state, is no
        structure.

    Raises
    ------
    InputError
        The scenario cannot be used, or the log does not fit it.
    """
    machine = Machine(scenario, {**(changes or {}), **log.conditions})
    suspects = selected(SUSPECTS, machine.model.actuator)
    aligned = align_rows(log)
    known, covariance = _known(machine, aligned, uncertainty)
    varied = list(dict.fromkeys([*suspects, *known]))
    shooting = Shooting(windows_of(aligned, machine, window_s), varied)
    values = np.array([machine.nominal(parameter) for parameter in varied])
    parts = shooting.parts(values, slopes=True)
    fit = fit_of(parts, shooting)
    full, gradient = normal_equations(parts)
    gradient = -gradient[: len(suspects)]
    information = np.diag(full)[: len(suspects)]
    shared = full[: len(suspects), [varied.index(one) for one in known]]
    variance = information * max(fit.chi2, 1.0) + np.einsum("ij,jk,ik->i", shared, covariance, shared)
    limit = norm.isf(_BY_CHANCE / 2 / len(suspects))
    is_seen = information > 0
    deviations = np.where(is_seen, gradient / np.sqrt(np.where(is_seen, variance, 1.0)), 0.0)
    structure = sorted(
        (
            Structure(one.name, float(gradient[i] / information[i]), one.kind.unit, float(deviations[i]))
            for i, one in enumerate(suspects)
            if abs(deviations[i]) > limit
        ),
        key=lambda one: -abs(one.deviations),
    )
    return Validation(CHI2[0] <= fit.chi2 <= CHI2[1] and not structure, fit, tuple(structure))


def _known(machine: Machine, log: Log, uncertainty: Uncertainty | None) -> tuple[list[Parameter], Array]:
    """Return the parameters that are known with errors, and their covariance."""
    sheet = priors(machine, log)
    identified = selected(uncertainty.names, machine.model.actuator) if uncertainty else []
    known = [*identified, *(one for one in sheet if one not in identified)]
    covariance = np.diag([sheet.get(one, 0.0) ** 2 for one in known])
    if uncertainty:
        covariance[: len(identified), : len(identified)] = uncertainty.covariance
    return known, covariance
