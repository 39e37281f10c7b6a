"""Origin of a torque curve or field: the geometry that it was computed for, and that of the model."""

from __future__ import annotations

from dataclasses import asdict

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import distinct_texts, one_line
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet
from spheretwin.models.torque_curve import TorqueCurve

# Numbers that older curve files do not name: before poles could be ground they were flat.
UNSAID = {"magnet front_radius_m": 0.0}

# The model's lengths come from sums and rotations, with errors of 1e-15; the torque is a low power of them.
# This tolerance means equality; a difference of a millionth of a percent is reported.
SAME = 1e-9


def computed_from(magnet: Magnet, coil: CoilGeometry) -> dict[str, float]:
    """Return every number that a computed curve depends on, by part and name, such as ``coil turns``."""
    parts = {"magnet": asdict(magnet), "coil": asdict(coil)}
    return {f"{part} {name}": value for part, data in parts.items() for name, value in data.items()}


def of_coil(coil: CoilGeometry) -> dict[str, float]:
    """Return every number of a coil that a torque field depends on, as `computed_from` does."""
    return {f"coil {name}": value for name, value in asdict(coil).items()}


def disagreements(actuator: Actuator) -> list[str]:
    """Return the differences between an actuator and the geometry of its torque curve, one line per number.

    Parameters
    ----------
    actuator : Actuator
        The actuator, with its torque curve or field.

    Returns
    -------
    list of str
        Empty if both agree, and for a curve without the numbers of its geometry: measured, or from another
        program. A curve with these numbers, but without the front radius, was computed for flat poles.
    """
    curve = actuator.torque_data
    unsaid = UNSAID if isinstance(curve, TorqueCurve) else {}  # a field is of any arrangement of magnets
    computed_for = unsaid | dict(curve.computed_for) if curve.computed_for else {}
    lines = []
    for name, has in computed_from(actuator.magnet, actuator.coil).items():
        had = computed_for.get(name, has)
        if abs(had - has) > SAME * max(abs(had), abs(has)):
            first, second = distinct_texts(had, has)
            lines.append(one_line(f"{curve.name} was computed for {name} {first}, the model has {second}"))
    return lines
