"""The torque curve f_t(phi): torque of one coil on one pole per ampere, against their angle."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.errors import InputError

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

COLUMNS = ("phi_deg", "torque_Nm_per_A")
FEWEST_ROWS = 8


@dataclass(frozen=True, eq=False)
class TorqueCurve:
    """Samples of f_t between 0 (pole in front of the coil) and 180 degrees.

    Attributes
    ----------
    phi_rad : (n,) array, rad
        Angle between pole axis and coil axis, rising from 0 to pi.
    torque_Nm_per_A : (n,) array, N·m/A
        Positive where a positive current pulls a north pole towards the coil's axis.
    """

    phi_rad: NDArray[np.float64]
    torque_Nm_per_A: NDArray[np.float64]

    @cached_property
    def spline(self) -> CubicSpline:
        """Cubic spline through the samples; f_t is odd about 0 and pi, so its second derivative ends at 0."""
        from scipy.interpolate import CubicSpline  # slow to import, needed once a process

        return CubicSpline(self.phi_rad, self.torque_Nm_per_A, bc_type="natural")

    @property
    def peak_Nm_per_A(self) -> float:
        """Largest sample, N·m/A."""
        return float(np.max(np.abs(self.torque_Nm_per_A)))

    def over_sine(self, cosine: NDArray[np.float64]) -> NDArray[np.float64]:
        """g(cos phi) = f_t(phi) / sin phi, finite at 0 and at pi.

        Parameters
        ----------
        cosine : (n,) array
            Cosine of the angle between pole and coil axis.

        Returns
        -------
        (n,) array, N·m/A
            The quotient; its limit where the sine vanishes.
        """
        cosine = np.clip(cosine, -1.0, 1.0)
        phi = np.arccos(cosine)
        sine = np.sin(phi)
        # Below 1e-7 rad the quotient and its limit agree to 1e-14: both ends are even in phi.
        regular = sine > 1e-7
        at_ends = np.where(cosine > 0, self.spline(0.0, 1), -self.spline(np.pi, 1))
        return np.where(regular, self.spline(phi) / np.where(regular, sine, 1.0), at_ends)


def read(path: Path) -> TorqueCurve:
    """Read a torque curve from CSV: a header, then ``phi_deg`` and ``torque_Nm_per_A`` a row.

    Lines that begin with ``#`` are comments (the provenance).

    Raises
    ------
    InputError
        The file cannot be read, lacks a column, or its samples are no curve from 0 to 180 degrees.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"torque curve {path}: expected a readable text file, {error}") from None
    rows = csv.DictReader(line for line in text.splitlines() if line and not line.startswith("#"))
    missing = [name for name in COLUMNS if name not in (rows.fieldnames or ())]
    if missing:
        found = ", ".join(rows.fieldnames or ()) or "none"
        raise InputError(f"torque curve {path}: expected the columns {', '.join(COLUMNS)}, received {found}")
    try:
        samples = np.array([[float(row[name]) for name in COLUMNS] for row in rows])
    except (TypeError, ValueError) as error:
        raise InputError(f"torque curve {path}: expected numbers only, received {error}") from None
    _check(path, samples)
    return TorqueCurve(np.radians(samples[:, 0]), samples[:, 1])


def to_csv(curve: TorqueCurve, provenance: list[str]) -> str:
    """Text of the CSV file of a curve, its provenance as leading comments."""
    text = io.StringIO()
    for line in provenance:
        text.write(f"# {line}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for phi, torque in zip(curve.phi_rad, curve.torque_Nm_per_A, strict=True):
        writer.writerow([f"{np.degrees(phi):.6g}", f"{torque:.12f}"])
    return text.getvalue()


def _check(path: Path, samples: NDArray[np.float64]) -> None:
    if len(samples) < FEWEST_ROWS:
        raise InputError(
            f"torque curve {path}: expected at least {FEWEST_ROWS} rows, received {len(samples)}"
        )
    if not np.all(np.isfinite(samples)):
        raise InputError(f"torque curve {path}: expected finite numbers, received NaN or infinity")
    angles = samples[:, 0]
    if np.any(np.diff(angles) <= 0):
        row = int(np.argmax(np.diff(angles) <= 0))
        raise InputError(
            f"torque curve {path}: expected rising angles,"
            f" received {angles[row]:g} then {angles[row + 1]:g} degrees"
        )
    if angles[0] != 0.0 or angles[-1] != 180.0:
        raise InputError(
            f"torque curve {path}: expected angles from 0 to 180 degrees,"
            f" received {angles[0]:g} to {angles[-1]:g}"
        )
