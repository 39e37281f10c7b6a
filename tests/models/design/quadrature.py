"""Computations with few points: errors of a thousandth tell right from wrong."""

from spheretwin.models.design import direct_summation, field_check, pole_torque
from spheretwin.models.design.direct_summation import Quadrature, Rule

COARSE = Quadrature(near=Rule(8, 8, 32, 8), far=Rule(6, 6, 24, 4))
"""A third of the standard points of a direct sum."""


def sum_coarsely(monkeypatch):
    """Use fewer points in the windings, and one machine with scatter instead of three."""
    monkeypatch.setattr(direct_summation, "STANDARD", COARSE)
    monkeypatch.setattr(field_check, "SCATTER_POSES", 1)


def sample_coarsely(monkeypatch):
    """Compute a twentieth of the samples of a curve and of its sensitivities: the checks, not the figures."""
    angles, sensitivity_rad = pole_torque.sample_angles(), pole_torque.SENSITIVITY_RAD
    monkeypatch.setattr(pole_torque, "sample_angles", lambda: angles[::20])
    monkeypatch.setattr(pole_torque, "SENSITIVITY_RAD", sensitivity_rad[::20])
