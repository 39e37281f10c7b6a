"""Torque field: torque of one coil on the rotor per ampere, as a vector function of the coil's direction.

The direction is that of the coil's axis in the rotor frame, by polar angle theta from z and azimuth phi from
x. A field describes any rotor, also one whose torque is not a sum over equal poles, and any coil whose torque
depends on the direction of its axis alone: a coil of revolution whose axis passes through the joint centre.

Between samples each component is the tensor product of cubic splines in theta and phi. A meridian continues
beyond a pole of the sphere as the opposite one, so that the samples are periodic in both angles.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from spheretwin.models import torque_curve
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, distinct_texts
from spheretwin.models.torque_curve import (
    COMPUTED_FOR,
    LARGEST_PEAK,
    LEAST_PEAK,
    TorqueCurve,
    decoded,
    named_numbers,
    read_columns,
)

COLUMNS = ("theta_deg", "phi_deg", "x_Nm_per_A", "y_Nm_per_A", "z_Nm_per_A")
FEWEST_LATITUDES, FEWEST_MERIDIANS = 7, 8

# Angles of a file have some decimals only.
ANGLE_TOLERANCE_DEG = 1e-3

# All meridians meet at a pole of the sphere; measured values may differ there, and their mean is taken.
LARGEST_POLE_SHARE = 0.01


@dataclass(frozen=True, eq=False)
class TorqueField:
    """Samples on equal steps of the polar angle from 0 to pi and of the azimuth over a full turn.

    Attributes
    ----------
    torque_Nm_per_A : (t, p, 3) array, N·m/A
        Torque on the rotor, rotor frame. Positive current runs counterclockwise about the outward axis.
    computed_for : mapping of str to float, optional
        Numbers of the coil that it was computed for, such as ``coil turns``; None if unknown.
    name : str
        Name in warnings.
    """

    torque_Nm_per_A: Array
    computed_for: Mapping[str, float] | None = None
    name: str = "torque field"

    @property
    def peak_Nm_per_A(self) -> float:
        """Largest magnitude of a sample, N·m/A."""
        return float(np.max(np.linalg.norm(self.torque_Nm_per_A, axis=2)))

    @property
    def content(self) -> tuple[Array, ...]:
        """Arrays that define the field."""
        return (self.torque_Nm_per_A,)

    @cached_property
    def coefficients(self) -> Array:
        """(t + 2, p + 3, 3) array, N·m/A: coefficients of the cubic B-splines, from one step before 0 on."""
        samples = self.torque_Nm_per_A
        beyond = np.roll(samples[-2:0:-1], samples.shape[1] // 2, axis=1)
        torus = np.concatenate([samples, beyond])  # (2t - 2, p, 3)
        rows, columns = torus.shape[:2]
        share = np.multiply.outer(_spline_values(rows), _spline_values(columns))
        torus = np.fft.ifft2(np.fft.fft2(torus, axes=(0, 1)) / share[..., None], axes=(0, 1)).real
        wrapped = np.arange(-1, columns + 2) % columns
        return np.ascontiguousarray(torus[np.arange(-1, len(samples) + 1) % rows][:, wrapped])

    def torque(self, axes: Array) -> Array:
        """Return the torque of one ampere in coils, rotor frame.

        Parameters
        ----------
        axes : (n, 3) array
            Unit vectors of the coils in the rotor frame.

        Returns
        -------
        (n, 3) array, N·m/A
        """
        rows, columns = (size - 3 for size in self.coefficients.shape[:2])
        theta = np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2])
        phi = np.mod(np.arctan2(axes[:, 1], axes[:, 0]), 2 * np.pi)
        place = np.stack([theta * rows / np.pi, phi * columns / (2 * np.pi)])  # (2, n)
        first = np.minimum(place.astype(int), np.array([[rows - 1], [columns - 1]]))
        row_weights, column_weights = (_weights(t) for t in place - first)  # (4, n)
        total = np.zeros((len(axes), 3))
        for i, j in np.ndindex(4, 4):
            share = row_weights[i] * column_weights[j]
            total += share[:, None] * self.coefficients[first[0] + i, first[1] + j]
        return total


TorqueData = TorqueCurve | TorqueField


def directions(latitudes: int, meridians: int) -> Array:
    """Return the unit vectors of the samples of a field, (latitudes, meridians, 3)."""
    theta = np.linspace(0.0, np.pi, latitudes)[:, None]
    phi = 2 * np.pi * np.arange(meridians) / meridians
    z = np.broadcast_to(np.cos(theta), (latitudes, meridians))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), z], axis=2)


def read(path: Path) -> TorqueData:
    """Read a torque curve, or a torque field: the columns of the file determine its kind.

    Raises
    ------
    InputError
        The file cannot be read, or holds neither.
    """
    return parse(path, torque_curve.read_bytes(path))


def parse(path: Path, content: bytes) -> TorqueData:
    """Return the torque curve or field of the content of a file; the path is for messages only."""
    label = f"torque field {path}"
    head = next((line for line in content.splitlines() if line.strip() and line[:1] != b"#"), b"")
    if COLUMNS[0].encode() not in head:
        return torque_curve.parse(path, content)
    text = decoded(label, content)
    samples = _grid(label, read_columns(label, text, COLUMNS))
    return TorqueField(samples, named_numbers(label, text, COMPUTED_FOR), f"torque field {path.name}")


def to_csv(field: TorqueField, provenance: Sequence[str]) -> str:
    """Return the text of the CSV file of a field, with its provenance as leading comments."""
    text = io.StringIO()
    text.writelines(f"# {line}\n" for line in provenance)
    text.write(",".join(COLUMNS) + "\n")
    latitudes, meridians = field.torque_Nm_per_A.shape[:2]
    theta, phi = np.linspace(0, 180, latitudes), np.arange(meridians) * 360 / meridians
    for i, j in np.ndindex(latitudes, meridians):
        torque = ",".join(f"{round(value, 9) + 0.0:.9f}" for value in field.torque_Nm_per_A[i, j])
        text.write(f"{theta[i]:.6g},{phi[j]:.6g},{torque}\n")
    return text.getvalue()


def _grid(label: str, rows: Array) -> Array:
    """Return the samples on their grid, (t, p, 3), from the rows of a file in any order."""
    if not np.all(np.isfinite(rows)):
        raise InputError(f"{label}: expected finite numbers, received NaN or infinity")
    rows = rows[np.lexsort(np.round(rows[:, 1::-1].T / ANGLE_TOLERANCE_DEG))]
    latitudes, meridians = (len(np.unique(np.round(angles / ANGLE_TOLERANCE_DEG))) for angles in rows.T[:2])
    if latitudes < FEWEST_LATITUDES or meridians < FEWEST_MERIDIANS or meridians % 2:
        raise InputError(
            f"{label}: expected at least {FEWEST_LATITUDES} values of theta_deg and an even number of at"
            f" least {FEWEST_MERIDIANS} of phi_deg, received {latitudes} and {meridians}"
        )
    theta, phi = np.linspace(0, 180, latitudes), np.arange(meridians) * 360 / meridians
    expected = np.stack(np.meshgrid(theta, phi, indexing="ij"), axis=2).reshape(-1, 2)
    same = len(rows) == len(expected) and np.abs(rows[:, :2] - expected).max() < ANGLE_TOLERANCE_DEG
    if not same:
        raise InputError(
            f"{label}: expected every pair of equal steps of theta_deg from 0 to 180 and of phi_deg from 0 to"
            f" below 360 once, received other angles in {len(rows)} rows"
        )
    samples = rows[:, 2:].reshape(latitudes, meridians, 3)
    peak = float(np.max(np.linalg.norm(samples, axis=2)))
    if not LEAST_PEAK < peak < LARGEST_PEAK:
        least, largest, received = distinct_texts(LEAST_PEAK, LARGEST_PEAK, peak)
        raise InputError(f"{label}: expected a peak between {least} and {largest} N·m/A, received {received}")
    ends, mean = samples[[0, -1]], samples[[0, -1]].mean(axis=1, keepdims=True)
    if (apart := float(np.abs(ends - mean).max())) > LARGEST_POLE_SHARE * peak:
        raise InputError(
            f"{label}: expected one torque at theta_deg 0 and one at 180, where all phi_deg are one"
            f" direction, received values that are {apart:g} N·m/A from their mean"
        )
    grid = samples.copy()
    grid[[0, -1]] = mean
    return grid


def _spline_values(count: int) -> Array:
    """Return the discrete Fourier transform of the values of a cubic B-spline at the samples, (count,)."""
    return np.asarray((2 + np.cos(2 * np.pi * np.arange(count) / count)) / 3)


def _weights(t: Array) -> Array:
    """Return the values of the four cubic B-splines at a fraction of a step, (4, ...)."""
    u = 1 - t
    return np.array([u**3 / 6, (3 * t**3 - 6 * t**2 + 4) / 6, (3 * u**3 - 6 * u**2 + 4) / 6, t**3 / 6])
