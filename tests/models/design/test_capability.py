"""Torque capability: against linear programmes, known shapes, the allocation, and symmetry."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from spheretwin.control.allocation.least_norm import allocate
from spheretwin.models.design import capability as capabilities
from spheretwin.models.design.capability import capability, torque_matrices
from spheretwin.models.design.workspace import FIGURES, grid, local_minima, pose, worst_by_tilt
from spheretwin.models.kinematics import rotation
from spheretwin.models.magnetics import torque_matrix
from tests.control.allocation.cases import largest_by_programme


def random_poses(count, seed=0):
    tilt, azimuth, spin = np.random.default_rng(seed).uniform([0, -3, -3], [1, 3, 3], (count, 3)).T
    return pose(tilt, azimuth, spin)


# The inscribed ball


@pytest.mark.parametrize(
    ("G", "radius"),
    [
        (np.eye(3), 1),  # a cube
        (np.hstack([np.eye(3), np.eye(3)]), 2),
        (np.diag([1.0, 2.0, 0.5]), 0.5),  # a box
        (np.array([[1.0, 0, 1], [0, 1, 1], [0, 0, 0]]), 0),  # flat
        (np.array([[1.0, 2], [2, 4], [3, 6]]), 0),  # a line
        (np.zeros((3, 4)), 0),
    ],
)
def test_known_shapes(G, radius):
    nearest, *_ = capabilities._nearest_facet(np.asarray(G, dtype=float))
    assert_allclose(nearest, radius, atol=1e-12)


def test_no_direction_has_less_and_the_facet_s_has_no_more(actuator):
    generator = np.random.default_rng(1)
    for q in random_poses(4):
        figures = capability(q[None], actuator)
        G = 8 * torque_matrix(q, actuator)
        worst = largest_by_programme(G, figures.best_direction[0], 1.0)
        assert_allclose(worst, figures.best_Nm[0], rtol=1e-7)  # the linear programme's tolerance
        for direction in generator.normal(size=(12, 3)):
            share = largest_by_programme(G, direction / np.linalg.norm(direction), 1.0)
            assert share >= worst * (1 - 1e-7)


# Least-norm currents


def test_allocation_just_reaches_the_least_norm_torque(actuator):
    limit = actuator.group.current_limit_A
    for q in random_poses(10):
        figures = capability(q[None], actuator)
        torque = figures.least_norm_Nm[0] * figures.least_norm_direction[0]
        G, current = torque_matrix(q, actuator), np.empty(18)
        assert allocate(G, 0.999_999 * torque, limit, current) == 1.0
        assert_allclose(np.abs(current).max(), limit, rtol=1e-5)
        assert allocate(G, 1.01 * torque, limit, current) == pytest.approx(1 / 1.01, rel=1e-6)
        assert_allclose(G @ current, torque, atol=1e-9)


def test_least_norm_torque_is_the_worst_over_directions(actuator):
    directions = np.random.default_rng(2).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for q in random_poses(5):
        inverse = np.linalg.pinv(torque_matrix(q, actuator))
        reached = 8 / np.abs(inverse @ directions.T).max(axis=0)
        worst = capability(q[None], actuator).least_norm_Nm[0]
        assert worst <= reached.min() < 1.02 * worst  # 2000 directions are 3 degrees apart


@pytest.mark.parametrize("resistance_ohm", [1.3, tuple(np.linspace(5.7, 8.3, 18))])
def test_singular_values_and_copper_loss(actuator, resistance_ohm):
    """The least heat of a torque is that of currents that minimise Σ R i², each with its own R."""
    actuator = replace(actuator, group=replace(actuator.group, resistance_ohm=resistance_ohm))
    q, root = random_poses(10), np.sqrt(np.broadcast_to(resistance_ohm, 18))
    figures = capability(q, actuator)
    for i, G in enumerate(torque_matrices(q, actuator)):
        assert_allclose(G, torque_matrix(q[i], actuator))
        sigma = np.linalg.svd(G, compute_uv=False)
        assert_allclose(figures.singular_value_Nm_per_A[i], sigma[2], rtol=1e-10)
        assert_allclose(figures.condition[i], sigma[0] / sigma[2], rtol=1e-10)
        scaled_current = np.linalg.pinv(G / root) @ figures.weak_direction[i]  # sqrt(R) i for 1 N·m
        assert_allclose(figures.copper_W_per_Nm2[i], scaled_current @ scaled_current, rtol=1e-10)


# The workspace


def test_pose_has_its_tilt_and_azimuth():
    R_SR = rotation(pose(0.9, 2.0, 0.4))
    expected = [np.sin(0.9) * np.cos(2.0), np.sin(0.9) * np.sin(2.0), np.cos(0.9)]
    assert_allclose(R_SR[:, 2], expected, atol=1e-15)
    turns = [rotation(np.array([0, 0, angle])) for angle in (2.0, 0.4 - 2.0)]
    tilted = rotation(np.array([0, 0.9, 0]))
    assert_allclose(R_SR, turns[0] @ tilted @ turns[1], atol=1e-15)


def test_grid_keeps_to_the_hinge_ranges(actuator):
    narrow = np.array([[-0.1, 0.1], [-0.2, 0.2], [-np.inf, np.inf]])
    workspace = grid(replace(actuator, hinge_range_rad=narrow), 20.0, 5.0, 8, 4)
    assert workspace.q.shape == (5, 8, 4, 3)
    assert workspace.reachable[0].all()
    assert not workspace.reachable[4].any()
    reached = workspace.q[workspace.reachable]
    assert np.all(np.abs(reached[:, 0]) <= 0.1)
    assert np.all(np.abs(reached[:, 1]) <= 0.2)
    assert np.any(np.abs(reached[:, 1]) > 0.1)
    assert_allclose(np.degrees(grid(actuator, 7.0, 3.0, 4, 4).tilt_rad), [0, 3, 6, 7])


@pytest.fixture(scope="module")
def sampled(actuator):
    """Coarse grid at tilts whose worst poses were measured by another program."""
    workspace = grid(actuator, 50.0, 10.0, 36, 60)
    flat = capability(workspace.q.reshape(-1, 3), actuator)
    return workspace, flat.reshaped(workspace.reachable.shape)


def test_least_norm_torque_by_tilt(sampled, actuator):
    workspace, on_grid = sampled
    result = worst_by_tilt(workspace, on_grid, FIGURES["least_norm"], actuator)
    worst = result.capability.least_norm_Nm
    assert np.all(worst <= on_grid.least_norm_Nm.min(axis=(1, 2)))
    # Searched by another program: 0.8745 at 0, 0.4183 at 20, 0.3780 at 30.
    assert_allclose(worst[[0, 2, 3]], [0.8745, 0.4183, 0.3780], rtol=1e-3)
    # Bounded currents give half as much again in the worst pose and direction, from 10 degrees on.
    assert np.all(on_grid.best_Nm.min(axis=(1, 2))[1:4] >= 1.5 * worst[1:4])
    # Tilts are kept, and the shaft's azimuth at 0 degrees is free.
    assert_allclose(result.tilt_azimuth_spin_rad[:, 0], workspace.tilt_rad)


def test_weakest_poses_come_first_and_once(sampled, actuator):
    workspace, on_grid = sampled
    figure = FIGURES["least_norm"]
    by_tilt = worst_by_tilt(workspace, on_grid, figure, actuator)
    weak = local_minima(workspace, by_tilt, figure, actuator)
    value = weak.capability.least_norm_Nm
    assert np.all(np.diff(value) >= 0)
    assert value[0] <= by_tilt.capability.least_norm_Nm.min()
    assert np.all(weak.tilt_azimuth_spin_rad[:, 0] <= workspace.tilt_rad[-1] + 1e-12)
    again = capability(weak.q, actuator)
    assert np.array_equal(again.least_norm_Nm, value)
    # No neighbour is weaker: these are minima.
    nearby = pose(*(weak.tilt_azimuth_spin_rad[0] + np.random.default_rng(6).normal(0, 1e-3, (200, 3))).T)
    inside = capability(nearby, actuator).least_norm_Nm
    assert inside.min() >= value[0] * (1 - 2e-3)
