"""Torque matrix of a machine with scatter against the sum over all poles and all coils."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin.models import actuator as actuators
from spheretwin.models import magnetics
from spheretwin.models.design.direct_summation import direct_torque_matrix
from spheretwin.models.design.workspace import pose
from spheretwin.models.scatter import Scatter, no_scatter, part_errors, scattered_model, summed_torque_matrix
from tests.models.design.quadrature import COARSE
from tests.models.poses import work_around_a_closed_path

ACTUATOR = actuators.load()
PARTS = (len(ACTUATOR.pole_axes), len(ACTUATOR.coil_axes))


def scatter(rng, gain=0.0, angle_rad=0.0, distance_m=0.0):
    bounds = [gain, angle_rad, angle_rad, distance_m]
    return Scatter(*(part_errors(rng.uniform(-1, 1, (parts, 4)) * bounds) for parts in PARTS))


def compiled(q, actuator, errors):
    model = scattered_model(actuator, errors)
    G = np.empty((3, len(actuator.groups)))
    magnetics.fill_torque_matrix(q, model.arrangement[0], model.tables, G, magnetics.scratch_of(model))
    return G


def poses(rng, count):
    tilt = rng.uniform(0, np.radians(57), count)
    return pose(tilt, *rng.uniform(-np.pi, np.pi, (2, count)))


def test_without_errors_both_sums_are_the_nominal_matrix():
    rng = np.random.default_rng(0)
    for q in poses(rng, 10):
        nominal = magnetics.torque_matrix(q, ACTUATOR)
        # The spline of the summed matrix and the look-up differ by 2e-7 of the peak for each of 8 lines.
        scale = 1e-6 * np.abs(nominal).max()
        np.testing.assert_allclose(compiled(q, ACTUATOR, no_scatter(ACTUATOR)), nominal, rtol=0, atol=1e-15)
        np.testing.assert_allclose(summed_torque_matrix(q, ACTUATOR), nominal, rtol=0, atol=scale)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32), gain=st.floats(0, 0.2))
def test_strengths_are_exact(seed, gain):
    """A part of a pair adds its own strength; only the far end of the curve has its neighbour's."""
    rng = np.random.default_rng(seed)
    errors = scatter(rng, gain)
    (q,) = poses(rng, 1)
    summed = summed_torque_matrix(q, ACTUATOR, errors)
    # The curve beyond 90 degrees, with the other weight, is 4e-4 of its peak.
    bound = (1e-6 + 1e-3 * gain) * np.abs(summed).max()
    np.testing.assert_allclose(compiled(q, ACTUATOR, errors), summed, rtol=0, atol=bound)


@pytest.mark.parametrize(("angle_rad", "distance_m"), [(1e-2, 0.0), (0.0, 3e-4)])
def test_errors_of_placement_vanish_with_their_square(angle_rad, distance_m):
    """Mean axes and mean stretches are exact to first order, with unequal strengths too."""
    left = {}
    for share in (1.0, 0.5, 0.25):
        rng = np.random.default_rng(5)
        worst = []
        for q in poses(rng, 40):
            errors = scatter(rng, 0.0, share * angle_rad, share * distance_m)
            difference = compiled(q, ACTUATOR, errors) - summed_torque_matrix(q, ACTUATOR, errors)
            worst.append(np.sqrt(np.mean(difference**2)))
        left[share] = np.sqrt(np.mean(np.square(worst)))
    # Second order is a factor of 4 for each half; the kinks of the curve and its look-up leave some tenths.
    assert left[1.0] / left[0.5] == pytest.approx(4.0, rel=0.15)
    assert left[0.5] / left[0.25] == pytest.approx(4.0, rel=0.15)


@pytest.mark.release("direct sums for 1.6 s; test_errors_of_placement_vanish_with_their_square is in less")
def test_one_moved_pole_and_one_moved_coil_are_where_their_errors_say():
    """The sum over displaced conductors in the field of displaced magnets, with nothing but geometry."""
    table = [np.zeros((parts, 4)) for parts in PARTS]
    table[0][5] = 0.1, 0.008, -0.006, 2e-4
    table[1][20] = -0.15, -0.004, 0.009, -2e-4
    errors = Scatter(*map(part_errors, table))
    q = np.array([0.3, -0.2, 0.5])
    exact = direct_torque_matrix(q, ACTUATOR, COARSE, errors)
    nominal = direct_torque_matrix(q, ACTUATOR, COARSE)
    change = exact - nominal
    model = compiled(q, ACTUATOR, errors) - magnetics.torque_matrix(q, ACTUATOR)
    # The change is about a tenth of the matrix; its second-order rest is a few percent of it.
    assert np.abs(change).max() > 0.03 * np.abs(nominal).max()
    np.testing.assert_allclose(model, change, rtol=0, atol=0.06 * np.abs(change).max())


def test_constant_currents_do_no_work_around_a_closed_path():
    """The torque is the slope of the co-energy, for scattered parts too."""
    errors, groups = scatter(np.random.default_rng(2), 0.1), PARTS[1] // 2
    work, power = work_around_a_closed_path(lambda q: summed_torque_matrix(q, ACTUATOR, errors), groups)
    assert abs(work) < 1e-4 * power


def test_a_pole_alone_has_a_line_of_its_own():
    rng = np.random.default_rng(4)
    alone = replace(ACTUATOR, pole_axes=ACTUATOR.pole_axes[:5], pole_polarity=ACTUATOR.pole_polarity[:5])
    lines = magnetics.pole_lines(alone.pole_axes)
    assert sorted(pole for line in lines for pole in line if pole >= 0) == list(range(5))
    errors = Scatter(part_errors(rng.uniform(-0.1, 0.1, (5, 4)) * [1, 0, 0, 0]), no_scatter(ACTUATOR).coils)
    q = np.array([0.1, 0.4, -0.3])
    summed = summed_torque_matrix(q, alone, errors)
    np.testing.assert_allclose(compiled(q, alone, errors), summed, rtol=0, atol=1e-4 * np.abs(summed).max())
    assert magnetics.torque_model(alone).sizes["lines"] == len(lines)
