"""Torque curve f_t(phi): torque of one coil on one pole per ampere, as a function of their angle."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError, distinct_texts, shown, without_breaks
from spheretwin.models.base.files import regular_file

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

COLUMNS = ("phi_deg", "torque_Nm_per_A")
FEWEST_ROWS = 8

# Starts of comments that name a number: of the geometry, and a sensitivity to the distance of a part in 1/m.
COMPUTED_FOR = "Computed for"
SENSITIVITY = "Per metre of distance,"
HEAD_LINE = r"^# *{start} ((?:magnet|coil) \w+):[ \t]*(.*?)[ \t]*\r?$"

# Angles closer than this are duplicates; peaks beyond these are mistakes of the unit.
CLOSEST_DEG = 1e-6
LEAST_PEAK, LARGEST_PEAK = 1e-12, 1e6

# By symmetry there is no torque on a pole directly in front of a coil, or behind it. A measured curve may
# have noise there; a larger value would be divided by a vanishing sine.
LARGEST_END_SHARE = 0.01


@dataclass(frozen=True, eq=False)
class TorqueCurve:
    """Samples of f_t between 0 (pole in front of the coil) and 180 degrees.

    Attributes
    ----------
    phi_rad : (n,) array, rad
        Angle between pole axis and coil axis, rising from 0 to pi.
    torque_Nm_per_A : (n,) array, N·m/A
        Positive where a positive current pulls a north pole towards the coil's axis.
    computed_for : mapping of str to float, optional
        Numbers of the geometry that it was computed for, such as ``coil turns``; None if unknown, as for
        measured data.
    distance_sensitivity : mapping of str to float, optional
        Change by a larger distance of the magnet or of the coil from the joint centre, 1/m: ``magnet gain``,
        ``magnet stretch``, ``coil gain``, ``coil stretch`` (`models.scatter`); None if unknown.
    name : str
        Name in warnings.
    """

    phi_rad: NDArray[np.float64]
    torque_Nm_per_A: NDArray[np.float64]
    computed_for: Mapping[str, float] | None = None
    distance_sensitivity: Mapping[str, float] | None = None
    name: str = "torque curve"

    @cached_property
    def spline(self) -> CubicSpline:
        """Cubic spline through the samples; f_t is odd about 0 and pi, so its second derivative ends at 0."""
        from scipy.interpolate import CubicSpline  # slow to import, used once per process

        return CubicSpline(self.phi_rad, self.torque_Nm_per_A, bc_type="natural")

    @property
    def peak_Nm_per_A(self) -> float:
        """Largest sample, N·m/A."""
        return float(np.max(np.abs(self.torque_Nm_per_A)))

    @property
    def content(self) -> tuple[NDArray[np.float64], ...]:
        """Arrays that define the curve."""
        return self.phi_rad, self.torque_Nm_per_A

    def over_sine(self, cosine: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return g(cos phi) = f_t(phi) / sin phi, finite at 0 and at pi.

        Parameters
        ----------
        cosine : (n,) array
            Cosine of the angle between pole and coil axis.

        Returns
        -------
        (n,) array, N·m/A
            The quotient, or its limit if the sine vanishes.
        """
        cosine = np.clip(cosine, -1.0, 1.0)
        phi = np.arccos(cosine)
        sine = np.sin(phi)
        # Below 1e-7 rad the quotient and its limit agree to 1e-14: both ends are even in phi.
        regular = sine > 1e-7
        at_ends = np.where(cosine > 0, self.spline(0.0, 1), -self.spline(np.pi, 1))
        return np.where(regular, self.spline(phi) / np.where(regular, sine, 1.0), at_ends)


def read(path: Path) -> TorqueCurve:
    """Read a torque curve from CSV: a header, then ``phi_deg`` and ``torque_Nm_per_A`` per row.

    Lines that begin with ``#`` are comments (the provenance); those written by `head` are read.

    Raises
    ------
    InputError
        The file cannot be read, lacks a column, its samples are not a curve from 0 to 180 degrees, or its
        head holds an invalid number.
    """
    return parse(path, read_bytes(path))


def read_bytes(path: Path) -> bytes:
    """Return the content of the file of a curve.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    try:
        return regular_file(path).read_bytes()
    except OSError as error:
        raise InputError(
            f"torque curve {path}: expected a readable text file, {without_breaks(error)}"
        ) from None


def parse(path: Path, content: bytes) -> TorqueCurve:
    """Return the torque curve of the content of a file; see `read`. The path is for messages only."""
    label = f"torque curve {path}"
    text = decoded(label, content)
    samples = read_columns(label, text, COLUMNS)
    _check(path, samples)
    return TorqueCurve(
        np.radians(samples[:, 0]),
        samples[:, 1],
        named_numbers(label, text, COMPUTED_FOR),
        named_numbers(label, text, SENSITIVITY),
        f"torque curve {path.name}",
    )


def decoded(label: str, content: bytes) -> str:
    """Return the text of a file; `label` names it in messages.

    Raises
    ------
    InputError
        It is not UTF-8.
    """
    try:
        return content.decode("utf-8-sig")  # spreadsheets write a byte-order mark
    except UnicodeDecodeError as error:
        raise InputError(f"{label}: expected a readable text file, {without_breaks(error)}") from None


def read_columns(label: str, text: str, columns: Sequence[str]) -> NDArray[np.float64]:
    """Return the named columns of a CSV text without its comments, (rows, columns).

    Raises
    ------
    InputError
        A column is missing or twice, a row has another number of columns, or a value is no number.
    """
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    rows = csv.DictReader(lines, skipinitialspace=True)
    try:
        header = [name or "" for name in rows.fieldnames or ()]
        missing = [name for name in columns if name not in header]
        records = list(rows)
    except csv.Error as error:
        raise InputError(f"{label}: expected numbers only, received {error}") from None
    if missing:
        raise InputError(
            f"{label}: expected the columns {', '.join(columns)}, received {', '.join(header) or 'none'}"
        )
    samples = np.array([[_number(label, row[name]) for name in columns] for row in records])
    uneven = next((i for i, row in enumerate(records) if None in row or None in row.values()), None)
    if uneven is not None or len(set(header)) < len(header):
        where = "a column twice" if uneven is None else f"another number of them in row {uneven + 1}"
        raise InputError(f"{label}: expected each column once in every row, received {where}")
    return samples.reshape(-1, len(columns))


def _number(label: str, text: Any) -> float:
    try:
        return float(text)
    except (TypeError, ValueError):  # a row that is too short has None
        raise InputError(f"{label}: expected numbers only, received {shown(text)}") from None


def head(computed_for: Mapping[str, float], sensitivity: Mapping[str, float]) -> list[str]:
    """Return the lines of provenance with the numbers of a curve, for readers and for `read`."""
    # 12 digits hide the rounding of a length that was a sum, but no difference that `disagreements` reports.
    geometry = [f"{COMPUTED_FOR} {name}: {value:.12g}" for name, value in computed_for.items()]
    return geometry + [f"{SENSITIVITY} {name}: {value:.4g}" for name, value in sensitivity.items()]


def to_csv(curve: TorqueCurve, provenance: list[str]) -> str:
    """Return the text of the CSV file of a curve, with its provenance as leading comments."""
    text = io.StringIO()
    for line in provenance:
        text.write(f"# {line}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for phi, torque in zip(curve.phi_rad, curve.torque_Nm_per_A, strict=True):
        writer.writerow([f"{np.degrees(phi):.6g}", f"{torque:.12f}"])
    return text.getvalue()


def named_numbers(label: str, text: str, start: str) -> dict[str, float] | None:
    """Return the numbers in the lines written by `head` that begin with `start`."""
    numbers = {}
    for name, number in re.findall(HEAD_LINE.format(start=start), text, re.MULTILINE):
        try:
            numbers[name] = float(number)
        except ValueError:
            numbers[name] = np.nan
        if not np.isfinite(numbers[name]):
            raise InputError(
                f"{label}: expected a finite number after {start} {name}:, received {number or 'none'}"
            )
    return numbers or None


def _check(path: Path, samples: NDArray[np.float64]) -> None:
    if len(samples) < FEWEST_ROWS:
        raise InputError(
            f"torque curve {path}: expected at least {FEWEST_ROWS} rows, received {len(samples)}"
        )
    if not np.all(np.isfinite(samples)):
        raise InputError(f"torque curve {path}: expected finite numbers, received NaN or infinity")
    angles, torque = samples.T
    outside = (angles < 0.0) | (angles > 180.0)
    if np.any(outside):
        least, largest, received = distinct_texts(0.0, 180.0, angles[np.argmax(outside)])
        raise InputError(
            f"torque curve {path}: expected angles from {least} to {largest} degrees,"
            f" received {received}, which is outside"
        )
    if np.any(np.diff(angles) < CLOSEST_DEG):
        row = int(np.argmax(np.diff(angles) < CLOSEST_DEG))
        first, then = distinct_texts(angles[row], angles[row + 1])
        raise InputError(f"torque curve {path}: expected rising angles, received {first} then {then} degrees")
    if angles[0] != 0.0 or angles[-1] != 180.0:
        least, largest, first, last = distinct_texts(0.0, 180.0, angles[0], angles[-1])
        raise InputError(
            f"torque curve {path}: expected angles from {least} to {largest} degrees,"
            f" received {first} to {last}"
        )
    peak = np.max(np.abs(torque))
    if not (peak == 0.0 or LEAST_PEAK < peak < LARGEST_PEAK):
        least, largest, received = distinct_texts(LEAST_PEAK, LARGEST_PEAK, peak)
        raise InputError(
            f"torque curve {path}: expected a peak between {least} and {largest} N·m/A, received {received}"
        )
    if peak == 0.0:
        raise InputError(f"torque curve {path}: expected a torque somewhere, received zeros only")
    if max(abs(torque[0]), abs(torque[-1])) > LARGEST_END_SHARE * peak:
        raise InputError(
            f"torque curve {path}: expected no torque at 0 and 180 degrees, where symmetry leaves none,"
            f" received {torque[0]:g} and {torque[-1]:g} N·m/A"
        )
