"""Bound of eddy currents: against the field of the coils over the sphere, and its powers."""

import magpylib
import numpy as np
import pytest

from spheretwin.models.design.eddy_currents import ALUMINIUM_S_m, eddy_viscous_bound_Nm_s, face_field_T_per_A
from tests.models.design.quadrature import winding_loops


def test_the_field_at_the_face_is_that_of_the_loops(actuator):
    coil = actuator.coil
    face = np.array([[0.0, 0.0, coil.distance_m - coil.length_m / 2]])
    field = magpylib.getB(winding_loops(coil, 40, 200), face, sumup=True)
    # Midpoints of 200 layers: the next power of a layer's height over the bore, (0.125 / 3)²/24.
    assert abs(field.ravel()[2]) == pytest.approx(face_field_T_per_A(actuator), rel=1e-3)
    assert face_field_T_per_A(actuator) == pytest.approx(7.7e-3, rel=0.01)


def test_the_bound_exceeds_the_dissipation_without_return_paths(actuator):
    """Numerical integral of (v B)² over the sphere of the shell for the coils one by one."""
    coil, radius = actuator.coil, actuator.coil.distance_m - actuator.coil.length_m / 2
    cosine, weight = np.polynomial.legendre.leggauss(400)
    points = radius * np.column_stack([np.sqrt(1 - cosine**2), np.zeros(400), cosine])
    field = magpylib.getB(winding_loops(coil, 8, 20), points * (1 - 1e-3), sumup=True)
    normal = np.einsum("ij,ij->i", field, points) / radius
    # Coils of independent currents add their squares. The mean squared speed is 2/3 of the largest.
    integral = 2 * np.pi * radius**2 * np.sum(weight * normal**2)
    dissipated = ALUMINIUM_S_m * 1e-3 * 36 * 2 / 3 * radius**2 * integral
    bound = eddy_viscous_bound_Nm_s(actuator, 1.0)
    assert 0.1 * bound < dissipated < bound
    assert bound == pytest.approx(7.2e-5, rel=0.02)  # the number of README.md


def test_the_bound_is_quadratic_in_the_current_and_linear_in_the_sheet(actuator):
    one = eddy_viscous_bound_Nm_s(actuator, 1.0)
    assert eddy_viscous_bound_Nm_s(actuator, 3.0) == pytest.approx(9 * one)
    assert eddy_viscous_bound_Nm_s(actuator, 1.0, 2e-3) == pytest.approx(2 * one)
    assert eddy_viscous_bound_Nm_s(actuator, 1.0, 1e-3, 0.0) == 0
