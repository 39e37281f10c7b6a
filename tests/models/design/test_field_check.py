"""The direct sum: right by itself, and able to tell a wrong model from a right one."""

from dataclasses import replace

import magpylib
import numpy as np
import pytest
from manifold3d import CrossSection, Manifold
from numpy.testing import assert_allclose

from spheretwin.models.design import direct_summation
from spheretwin.models.design.direct_summation import Rule
from spheretwin.models.design.pole_torque import compute_curve
from spheretwin.models.magnetics import torque_matrix
from spheretwin.models.torque_curve import TorqueCurve
from tests.models.design.quadrature import COARSE

TILTS = np.radians([8.0, 50.0])


@pytest.fixture(scope="module")
def compared(actuator):
    return direct_summation.compare(actuator, TILTS, seed=3, quadrature=COARSE)


def torque_on_coils(actuator, pole, axes, rule):
    magnet = direct_summation.pole_magnet(actuator.magnet, pole, 1.0, rule.stacked)
    return direct_summation.torque_on_coils(magnet, axes, np.zeros(len(axes)), actuator.coil, rule)


def flat(actuator):
    return replace(actuator, magnet=replace(actuator.magnet, front_radius_m=0.0))


def pair_errors(actuator, rule, degrees=(2.0, 7.0, 10.5, 18.0)):
    """Distance of a pair's torque by the direct sum from the current sheet's, over the curve's peak."""
    expected = compute_curve(actuator.magnet, actuator.coil, np.radians(degrees)).torque_Nm_per_A
    z = np.array([[0.0, 0.0, 1.0]])
    axes = [np.array([np.sin(phi), 0.0, np.cos(phi)]) for phi in np.radians(degrees)]
    pulls = [torque_on_coils(actuator, axis, z, rule)[0, 1] for axis in axes]
    return (np.array(pulls) - expected) / actuator.torque_curve.peak_Nm_per_A


# The ground body as a stack of cylinders


@pytest.mark.parametrize("stacked", [1, 5, 24])
def test_a_stack_has_the_volume_of_the_ground_pole(actuator, stacked):
    magnet = actuator.magnet
    pieces = direct_summation.cylinders(magnet, stacked)
    assert len(pieces) == stacked
    volume = sum(np.pi * radius**2 * (top - bottom) for radius, bottom, top in pieces)
    assert volume == pytest.approx(magnet.volume_m3, rel=1e-12)
    # Each stands on the next, the last on the back.
    assert [bottom for _, bottom, _ in pieces] == [*(top for _, _, top in pieces[1:]), magnet.back_m]
    assert magnet.rim_m < pieces[-1][2] <= pieces[0][2] < magnet.front_m


def test_a_flat_pole_is_one_cylinder(actuator):
    magnet = flat(actuator).magnet
    assert direct_summation.cylinders(magnet, 24) == [(magnet.radius_m, magnet.back_m, magnet.front_m)]


def drawn_body(magnet, sections, steps):
    """The ground body as magpylib's own mesh of triangles, its axis along z."""
    rho = np.linspace(magnet.radius_m, 0.0, steps + 1)
    front = [(r, magnet.front_m - magnet.sagitta_at_m(r)) for r in rho]
    outline = CrossSection([np.array([(0.0, magnet.back_m), (magnet.radius_m, magnet.back_m), *front])])
    solid = Manifold.revolve(outline, sections).to_mesh64()
    return magpylib.magnet.TriangularMesh(
        vertices=solid.vert_properties[:, :3],
        faces=solid.tri_verts,
        polarization=(0.0, 0.0, magnet.remanence_T),
        reorient_faces="skip",  # manifold3d's solids are closed, their faces outward
        check_selfintersecting="skip",
    )


def test_a_stack_s_field_tends_to_that_of_the_body(actuator):
    # At the faces of the windings and beyond: where the conductors are.
    magnet, z = actuator.magnet, np.array([0.0, 0.0, 1.0])
    angle = np.radians(np.linspace(0.5, 25.0, 12))
    arc = np.column_stack([np.sin(angle), 0 * angle, np.cos(angle)])
    points = np.concatenate([distance_m * arc for distance_m in (0.0515, 0.053, 0.06)])
    # Facets miss the circle by the square of their angle: the limit of two meshes.
    coarse, fine = (drawn_body(magnet, n, n // 4).getB(points) for n in (48, 96))
    body = fine + (fine - coarse) / 3
    off = [
        np.abs(direct_summation.pole_magnet(actuator.magnet, z, 1.0, stacked).getB(points) - body).max()
        / np.abs(body).max()
        for stacked in (8, 16, 32)
    ]
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.25)
    assert off[1] / off[2] == pytest.approx(4.0, rel=0.25)
    assert off[2] < 5e-4


@pytest.mark.release("sums over all windings for 1 to 3 s; a flat pole is compared in less")
def test_a_pair_s_torque_tends_to_the_current_sheet_s(actuator):
    few, more, many = (pair_errors(actuator, Rule(12, 12, 48, stacked)) for stacked in (6, 12, 24))
    # Steps miss the front by the square of their number, and nothing else is left.
    assert_allclose(few / more, 4.0, rtol=0.1)
    assert_allclose(more / many, 4.0, rtol=0.1)
    assert np.abs(many).max() < 2e-4  # measured: 1.6e-4


def test_a_flat_pole_s_torque_is_the_current_sheet_s(actuator):
    # Its rim lies within the winding near 7 degrees: a quadrature of an infinite field.
    assert np.abs(pair_errors(flat(actuator), direct_summation.FLAT.near)).max() < 5e-4


def error_share(compared, actuator):
    errors = direct_summation.errors(compared, actuator.group.current_limit_A)
    return errors.model_Nm.max() / errors.torque_Nm.max()


def test_turns_have_their_length(actuator):
    coil = actuator.coil
    position, element = direct_summation.conductors(coil, Rule(4, 4, 12))
    mean = (coil.inner_radius_m + coil.outer_radius_m) / 2
    assert_allclose(np.linalg.norm(element, axis=1).sum(), coil.turns * 2 * np.pi * mean, rtol=1e-12)
    assert_allclose(np.sum(element * position, axis=1), 0, atol=1e-15)
    # Counterclockwise about the outward axis.
    assert np.all(np.cross(position, element)[:, 2] > 0)
    assert position[:, 2].min() > coil.distance_m - coil.length_m / 2


def test_a_pair_s_torque_is_normal_to_its_two_axes(actuator):
    # What makes the paper's sum exact; here from the full vector field, at an arbitrary place.
    pole, axis = (pose_axis / np.linalg.norm(pose_axis) for pose_axis in np.array([[1, 0.2, 0.3], [1, 0, 0]]))
    (torque,) = torque_on_coils(actuator, pole, axis[None], Rule(8, 8, 32))
    size = np.linalg.norm(torque)
    # The trapezoidal rule around the coil is not mirrored about the pair's plane: what it leaves.
    assert abs(torque @ axis) < 1e-5 * size
    assert abs(torque @ pole) < 1e-4 * size
    assert torque @ np.cross(pole, axis) < 0  # the coil is pulled towards the pole


def test_the_model_is_the_direct_sum_and_a_wrong_curve_is_not(compared, actuator):
    # Measured: 1e-3 on this coarse quadrature; 1e-4 on the default one.
    assert error_share(compared, actuator) < 3e-3
    curve = actuator.torque_curve
    wrong = replace(actuator, torque_data=TorqueCurve(curve.phi_rad, 1.02 * curve.torque_Nm_per_A))
    model = np.array([torque_matrix(q, wrong) for q in compared.q])
    assert error_share(compared._replace(model=model), actuator) > 0.01


def test_same_seed_same_poses(actuator, monkeypatch):
    monkeypatch.setattr(direct_summation, "direct_torque_matrix", lambda *_: np.zeros((3, 18)))
    first, again, other = (direct_summation.compare(actuator, TILTS, seed=seed).q for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
