"""What a torque curve was computed for, beside the model that uses it."""

from __future__ import annotations

from dataclasses import asdict

from spheretwin.models.actuator import Actuator, Coil, Magnet
from spheretwin.models.wording import one_line, told_apart

# The model's lengths come from sums and rotations, and keep 1e-15; a torque follows its numbers as a
# small power. So this is equality, while the millionth part of a percent is told.
SAME = 1e-9


def numbers(magnet: Magnet, coil: Coil) -> dict[str, float]:
    """Every number that a computed curve depends on, by part and name, such as ``coil turns``."""
    parts = {"magnet": asdict(magnet), "coil": asdict(coil)}
    return {f"{part} {name}": value for part, data in parts.items() for name, value in data.items()}


def disagreements(actuator: Actuator) -> list[str]:
    """Where the actuator differs from what its torque curve was computed for, one line a number.

    Parameters
    ----------
    actuator : Actuator
        With the curve that its torque is taken from.

    Returns
    -------
    list of str
        Empty where both agree, and for a curve that does not say what it was computed for: measured, or
        from another program.
    """
    curve = actuator.torque_curve
    computed_for = curve.computed_for or {}
    lines = []
    for name, has in numbers(actuator.magnet, actuator.coil).items():
        had = computed_for.get(name, has)
        if abs(had - has) > SAME * max(abs(had), abs(has)):
            first, second = told_apart(had, has)
            lines.append(one_line(f"{curve.name} was computed for {name} {first}, the model has {second}"))
    return lines
