"""Finite elements of the iron behind a pole: exact spheres, the image limit, air, and mesh convergence."""

import sys

import numpy as np
import pytest

from spheretwin import cli
from tests.docs.snippets import ROOT

sys.path.insert(0, str(ROOT / "docs" / "scripts"))

import iron_hoop
from iron_hoop import Iron, Shape, effect, harmonics, torque_curve

INNER, OUTER, FRONT, SPHERE = 0.0365, 0.0400, 0.0500, 0.0550


def sphere(charge):
    """Concentric spheres, with a charge over the one of the front."""
    radii = [lambda psi, r=r: np.full_like(psi, r) for r in (INNER, OUTER, FRONT)]
    return Shape(*radii, SPHERE, (np.pi,), lambda psi, normal: (0 * psi, charge(psi)))


def shell(permeability):
    """Potential of degree 1 outside a charge cos(psi) on the front, with a shell of iron; A per A/m.

    In each of the four regions it is ``a r + b / r²``; it is continuous, and so is ``µ dΦ/dr`` but for the
    charge.
    """
    edges, relative = (INNER, OUTER, FRONT), (1.0, permeability, 1.0, 1.0)
    matrix, right = np.zeros((8, 8)), np.zeros(8)
    for i, r in enumerate(edges):
        for side, sign in ((i, 1.0), (i + 1, -1.0)):
            matrix[2 * i, 2 * side : 2 * side + 2] = sign * r, sign / r**2
            matrix[2 * i + 1, 2 * side : 2 * side + 2] = np.array([1.0, -2 / r**3]) * sign * relative[side]
    right[5] = 1.0  # the slope falls by the charge at the front
    matrix[6, 1] = matrix[7, 6] = 1.0  # finite at the centre and far away
    return np.linalg.solve(matrix, right)[7] / SPHERE**2


@pytest.mark.parametrize("permeability", [1.0, 1000.0])
def test_a_magnetised_sphere_around_a_shell_of_iron_is_exact(permeability):
    iron = Iron(np.pi, INNER, permeability)
    potential = harmonics(sphere(np.cos), iron, 1.0, 32)
    if permeability == 1:
        assert shell(1.0) == pytest.approx(FRONT**3 / (3 * SPHERE**2), rel=1e-12)  # M a³ / 3 r²
    # The hole at the centre has 2e-5 of the volume within the shell.
    assert potential[1] == pytest.approx(shell(permeability), rel=1e-4)
    assert np.abs(np.delete(potential, 1)).max() < 1e-3 * potential[1]  # steps of the angle grow to 6 degrees


def test_the_error_falls_with_the_mesh():
    errors = []
    for elements in (4, 8, 16):
        potential = harmonics(sphere(np.cos), Iron(np.pi, INNER, 10.0), 1.0, elements)
        errors.append(abs(potential[1] / shell(10.0) - 1))
    assert errors[0] > 4 * errors[1]  # biquadratic elements on a smooth field: at least order 2
    assert errors[1] > 4 * errors[2]


def test_large_permeability_is_the_image_in_a_sphere():
    """The potential vanishes on the iron: of a charge of degree l at the front (1 - (r/a)^(2l+1)) is left."""
    degree = 3

    def charge(psi):
        return np.polynomial.legendre.Legendre.basis(degree)(np.cos(psi))

    irons = (Iron(np.pi, INNER, permeability) for permeability in (1e6, 1.0))
    with_iron, bare = (harmonics(sphere(charge), iron, 1.0, 12)[degree] for iron in irons)
    # Measured: 1.4e-4; 5e-6 with 32 elements.
    assert with_iron / bare == pytest.approx(1 - (OUTER / FRONT) ** (2 * degree + 1), rel=1e-3)


def test_without_iron_the_pole_has_its_torque_curve(actuator):
    phi = np.radians(np.arange(0.5, 40.0, 0.5))
    exact, errors = actuator.torque_curve.spline(phi), []
    for elements in (6, 12):
        curve = torque_curve(actuator.magnet, actuator.coil, None, phi, elements)
        errors.append(np.abs(curve - exact).max() / exact.max())
    assert errors[1] < 5e-3  # 4e-4 with 24 elements
    assert errors[0] > 4 * errors[1]


@pytest.mark.release("finite elements for 1 to 5 s; the image in a sphere is exact, in less")
@pytest.mark.parametrize("half_angle_deg", [11.0, 180.0])
def test_the_effect_of_iron_converges_below_its_image(half_angle_deg, actuator):
    coarse, fine = (effect(actuator.magnet, actuator.coil, half_angle_deg, count) for count in (8, 16))
    # Singularities at the edges of iron and magnet leave an order of 4/3 and more.
    assert coarse.mesh > 2 * fine.mesh
    assert 1 < fine.peak < 1.17  # an infinite plane of iron
    assert 1 < fine.mean < 1.24


def test_the_script_prints_all_caps(monkeypatch, capsys):
    monkeypatch.setattr(iron_hoop, "ELEMENTS", 4)
    monkeypatch.setattr(iron_hoop, "HALF_ANGLES_DEG", (20.0,))
    iron_hoop.main()
    _, _, row = capsys.readouterr().out.splitlines()
    assert row.startswith("| 20° | 1.")


def test_the_verb_names_the_script(capsys):
    assert cli.main(["magnetics", "hoop"]) == cli.BAD_INPUT
    assert "docs/scripts/iron_hoop.py" in capsys.readouterr().err
