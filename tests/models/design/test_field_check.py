"""The direct sum: right by itself, and able to tell a wrong model from a right one."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from spheretwin.models.design import field_check
from spheretwin.models.design.field_check import Quadrature, Rule
from spheretwin.models.design.workspace import pose
from spheretwin.models.magnetics import torque_matrix
from spheretwin.models.torque_curve import TorqueCurve

COARSE = Quadrature(near=Rule(12, 12, 48), far=Rule(6, 6, 24))
TILTS = np.radians([8.0, 50.0])


@pytest.fixture(scope="module")
def compared(actuator):
    return field_check.compare(actuator, TILTS, seed=3, quadrature=COARSE)


def error_share(compared, actuator):
    errors = field_check.errors(compared, actuator.group.current_limit_A)
    return errors.model_Nm.max() / errors.torque_Nm.max()


def test_turns_have_their_length(actuator):
    coil = actuator.coil
    position, element = field_check._conductors(coil, Rule(4, 4, 12))
    mean = (coil.inner_radius_m + coil.outer_radius_m) / 2
    assert_allclose(np.linalg.norm(element, axis=1).sum(), coil.turns * 2 * np.pi * mean, rtol=1e-12)
    assert_allclose(np.sum(element * position, axis=1), 0, atol=1e-15)
    # Counterclockwise about the outward axis.
    assert np.all(np.cross(position, element)[:, 2] > 0)
    assert position[:, 2].min() > coil.distance_m - coil.length_m / 2


def test_a_pair_s_torque_is_normal_to_its_two_axes(actuator):
    # What makes the paper's sum exact; here from the full vector field, at an arbitrary place.
    pole, axis = (pose_axis / np.linalg.norm(pose_axis) for pose_axis in np.array([[1, 0.2, 0.3], [1, 0, 0]]))
    magnet = field_check._magnet(actuator, pole, 1.0)
    (torque,) = field_check._torque_on_coils(magnet, axis[None], actuator.coil, Rule(8, 8, 32))
    size = np.linalg.norm(torque)
    # The trapezoidal rule around the coil is not mirrored about the pair's plane: what it leaves.
    assert abs(torque @ axis) < 1e-5 * size
    assert abs(torque @ pole) < 1e-4 * size
    assert torque @ np.cross(pole, axis) < 0  # the coil is pulled towards the pole


def test_model_is_the_direct_sum(compared, actuator):
    # Measured: 8e-4 on this coarse quadrature; 2e-4 on the default one.
    assert error_share(compared, actuator) < 3e-3


def test_finer_sums_come_closer(actuator):
    # The error of the sum falls with its points, and the model is what it tends to.
    q = pose(TILTS[0], 0.7, 0.3)
    G = torque_matrix(q, actuator)
    distance = [
        np.linalg.norm(field_check.direct_torque_matrix(q, actuator, quadrature) - G)
        for quadrature in (COARSE.halved(), COARSE, Quadrature())
    ]
    assert distance[2] < distance[1] < distance[0]
    assert distance[2] < distance[0] / 5


def test_wrong_polarity_is_found(compared, actuator):
    polarity = actuator.pole_polarity.copy()
    polarity[5] *= -1
    wrong = replace(actuator, pole_polarity=polarity)
    model = np.array([torque_matrix(q, wrong) for q in compared.q])
    assert error_share(compared._replace(model=model), actuator) > 0.05


def test_wrong_curve_is_found(compared, actuator):
    curve = actuator.torque_curve
    wrong = replace(actuator, torque_curve=TorqueCurve(curve.phi_rad, 1.02 * curve.torque_Nm_per_A))
    model = np.array([torque_matrix(q, wrong) for q in compared.q])
    assert error_share(compared._replace(model=model), actuator) > 0.01


def test_same_seed_same_poses(actuator, monkeypatch):
    monkeypatch.setattr(field_check, "direct_torque_matrix", lambda *_: np.zeros((3, 18)))
    first, again, other = (field_check.compare(actuator, TILTS, seed=seed).q for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
