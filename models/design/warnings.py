"""What a user should know of a geometry before believing its figures: one line each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator, from_model
from spheretwin.models.base.errors import InputError
from spheretwin.models.design.clearance import Overlap, air_gap_m, overlaps
from spheretwin.models.magnetics import disagreements
from spheretwin.models.mjcf import read
from spheretwin.models.torque_curve import TorqueCurve


def of_model_file(mjcf: Path, curve: TorqueCurve) -> list[str]:
    """Warnings for a model file that may still lack what the torque curve does not need.

    Parameters
    ----------
    mjcf : Path
        Model file.
    curve : TorqueCurve
        Held against it, or just computed from it.
    """
    try:
        return of_geometry(from_model(read(mjcf).described, curve))
    except InputError:
        return []


def of_geometry(actuator: Actuator) -> list[str]:
    """Parts that overlap, then numbers that differ from what the torque curve was computed for."""
    return [*of_parts(actuator), *disagreements(actuator)]


def of_parts(actuator: Actuator) -> list[str]:
    """Parts that overlap: coils and the ball, coils and coils, poles and poles (the deepest pair)."""
    found = overlaps(actuator)
    lines = []
    for part, axes in (("coil", actuator.coil_axes), ("pole", actuator.pole_axes)):
        pairs = [overlap for overlap in found if overlap.part == part]
        if pairs:
            lines.append(_line(pairs, axes))
    if (gap_m := air_gap_m(actuator)) < 0:
        lines.append(f"the coils' faces reach {-1e3 * gap_m:.2g} mm into the ball that the poles sweep")
    return lines


def _line(pairs: list[Overlap], axes: NDArray[np.float64]) -> str:
    deepest = pairs[0]
    first, second = (_place(deepest.part, i, axes) for i in (deepest.first, deepest.second))
    more = f", and {len(pairs) - 1} more pairs" if len(pairs) > 1 else ""
    return f"{first} and {second} overlap by {1e3 * deepest.depth_m:.2g} mm{more}"


def _place(part: str, index: int, axes: NDArray[np.float64]) -> str:
    x, y, z = axes[index]
    latitude, azimuth = np.degrees(np.arcsin(np.clip(z, -1.0, 1.0))), np.degrees(np.arctan2(y, x))
    return f"{part} {index} (latitude {latitude:.0f}°, azimuth {azimuth % 360:.0f}°)"
