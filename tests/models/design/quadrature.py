"""Computations with few points: errors of a thousandth tell right from wrong; windings as loops."""

import magpylib
import numpy as np

from spheretwin.models.design import pole_torque
from spheretwin.models.design.direct_summation import Quadrature, Rule

COARSE = Quadrature(near=Rule(8, 8, 32, 8), far=Rule(6, 6, 24, 4))
"""A third of the standard points of a direct sum."""


def winding_section(coil, across, along):
    """Radii, distances from the joint centre and shares of a winding's section at its Gauss points."""
    u, share_u = np.polynomial.legendre.leggauss(across)
    v, share_v = np.polynomial.legendre.leggauss(along)
    radii = (coil.outer_radius_m + coil.inner_radius_m + (coil.outer_radius_m - coil.inner_radius_m) * u) / 2
    r, z = np.meshgrid(radii, coil.distance_m + coil.length_m * v / 2, indexing="ij")
    return list(zip(r.ravel(), z.ravel(), np.outer(share_u, share_v).ravel() / 4, strict=True))


def winding_loops(coil, across, along):
    """The winding of one ampere as loops at the Gauss points of its section."""
    return [
        magpylib.current.Circle(diameter=2 * r, current=share * coil.turns, position=(0, 0, z))
        for r, z, share in winding_section(coil, across, along)
    ]


def sample_coarsely(monkeypatch):
    """Compute a twentieth of the samples of a curve and of its sensitivities: the checks, not the figures."""
    angles, sensitivity_rad = pole_torque.sample_angles(), pole_torque.SENSITIVITY_RAD
    monkeypatch.setattr(pole_torque, "sample_angles", lambda: angles[::20])
    monkeypatch.setattr(pole_torque, "SENSITIVITY_RAD", sensitivity_rad[::20])
