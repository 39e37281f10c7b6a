"""Rounded corners: stated acceleration, nothing changed beside them, the smallest that works told."""

import re

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from spheretwin.trajectories.rounding import Corners, least_acceleration, no_corners, rounded
from spheretwin.trajectories.shapes import Nutation, Sinusoid, Steps, Tilt

ANGLES = st.floats(-2, 2).filter(lambda angle: angle == 0 or abs(angle) > 1e-6)
POSE = st.tuples(ANGLES, ANGLES, ANGLES)


MOVES = st.lists(st.tuples(st.floats(0.01, 2), POSE), min_size=1, max_size=6)


def steps_of(moves, start):
    gaps, poses = zip(*moves, strict=True)
    return Steps(times_s=tuple(np.cumsum(gaps).tolist()), angles_rad=poses, start_rad=start)


STEPS = st.builds(steps_of, MOVES, POSE)
TILTS = st.builds(
    Tilt, rate_rad_s=st.floats(-3, 3).filter(lambda rate: abs(rate) > 1e-6), phase_s=st.floats(0.01, 3)
)


def least_of(shape):
    with pytest.raises(ValidationError) as refusal:
        shape.model_validate({**shape.model_dump(), "rounding_rad_s2": 1e-6})
    return float(re.search(r"at least (\S+) rad/s²", str(refusal.value))[1])


def with_rounding(shape, acceleration):
    return shape.model_validate({**shape.model_dump(), "rounding_rad_s2": acceleration})


def jumps(shape):
    """Whether a shape has anything to round, in windows that could meet."""
    corners = shape.corners()
    return least_acceleration(shape.sharp(np.zeros(1))[0, 1], corners) > 1e-6


@pytest.mark.release("1.6 s; the exact rounding of one corner is compared in less")
@given(STEPS | TILTS, st.floats(1, 100))
def test_motion_is_the_integral_of_a_bounded_acceleration(shape, excess):
    assume(jumps(shape))
    a = least_of(shape) * excess
    assume(a < 1e8)
    motion = with_rounding(shape, a)
    t = np.linspace(0, 20, 20001)
    angle, rate, acceleration = np.moveaxis(motion.sample(t), 1, 0)
    assert set(np.unique(np.abs(acceleration))) <= {0.0, a}
    dt = t[1]
    # Between two samples rates change by a dt at most; by the trapezium, angles are off by half of it, times
    # dt, and by rounding of some rad. A jump that were left would be millions of times more.
    np.testing.assert_array_less(np.abs(np.diff(rate, axis=0)), a * dt * (1 + 1e-9) + 1e-9)
    moved = (rate[1:] + rate[:-1]) / 2 * dt
    np.testing.assert_array_less(np.abs(np.diff(angle, axis=0) - moved), a * dt**2 / 2 + 1e-9)
    # It begins where the sharp motion does, and ends there too.
    np.testing.assert_array_equal(rate[0], 0.0)
    np.testing.assert_array_equal(motion.sample(np.array([1e6]))[0], shape.sharp(np.array([1e6]))[0])


@given(STEPS | TILTS)
def test_smallest_acceleration_told_is_the_smallest(shape):
    assume(jumps(shape))
    least = least_of(shape)
    assert with_rounding(shape, least).rounding_rad_s2 == least
    with pytest.raises(ValidationError, match="no corner overlaps the next"):
        with_rounding(shape, least * (1 - 2e-5))  # told in six digits, rounded up


def test_tilt_s_corners_are_parabolas_about_them():
    rate, a = np.pi / 30, 2.0
    half = rate / a / 2
    tilt, sharp = Tilt(rounding_rad_s2=a), Tilt()
    for corner, before, jump in ((2.0, rate, -rate), (4.0, 0.0, -rate), (6.0, -rate, rate)):
        share = np.linspace(-0.999, 0.999, 21)
        samples = tilt.sample(corner + half * share)[:, :, 0]
        at = sharp.sample(np.array([corner]))[0, 0, 0]
        expected = at + before * half * share + jump * half / 4 * (1 + share) ** 2
        np.testing.assert_allclose(samples[:, 0], expected, atol=1e-15)
        rate_of = before + jump * (1 + share) / 2
        np.testing.assert_allclose(samples[:, 1], rate_of, atol=1e-13)  # ulp of t / half
        np.testing.assert_array_equal(samples[:, 2], np.sign(jump) * a)
    t = np.linspace(0, 8, 8001)
    straight = (np.abs(t[:, None] - [2.0, 4.0, 6.0]) > half).all(axis=1) & (t > 2.42 * rate / a)
    assert tilt.sample(t)[straight].tobytes() == sharp.sample(t)[straight].tobytes()


def test_a_step_becomes_the_quickest_move_from_rest_to_rest():
    a, way = 8.0, np.array([0.5, -0.02, 0.0])
    steps = Steps(times_s=(1.0,), angles_rad=(tuple(way.tolist()),), rounding_rad_s2=a)
    for axis in (0, 1):
        lasts = 2 * np.sqrt(abs(way[axis]) / a)  # no move of that acceleration is shorter
        t = 1.0 + lasts * np.array([-1e-6, 0.25, 0.5, 0.75, 1 + 1e-6])
        angle, rate, acceleration = steps.sample(t)[:, :, axis].T
        np.testing.assert_allclose(angle, way[axis] * np.array([0, 1 / 8, 1 / 2, 7 / 8, 1]), atol=1e-15)
        fastest = np.sign(way[axis]) * np.sqrt(a * abs(way[axis]))
        np.testing.assert_allclose(rate, fastest * np.array([0, 0.5, 1, 0.5, 0]), atol=1e-14)
        signs = np.sign(way[axis]) * np.array([0, 1, -1, 0])
        np.testing.assert_array_equal(acceleration[[0, 1, 3, 4]], a * signs)
    np.testing.assert_array_equal(steps.sample(np.linspace(0, 3, 301))[:, :, 2], 0.0)


@pytest.mark.parametrize("shape", [Nutation, Sinusoid])
def test_a_start_with_a_rate_becomes_a_catching_up_from_rest(shape):
    a = 60.0
    sharp, motion = shape(), shape(rounding_rad_s2=a)
    t = np.linspace(0, 1, 10001)
    added = motion.sample(t) - sharp.sample(t)
    for axis, rate in enumerate(sharp.sample(np.zeros(1))[0, 1]):
        lasts = (1 + np.sqrt(2)) * rate / a
        np.testing.assert_array_equal(added[t > lasts, :, axis], 0.0)
        within = t < lasts - 1e-9
        np.testing.assert_allclose(np.abs(added[within, 2, axis]), a, rtol=1e-13)
        # Pushed for 1 + 1/√2 of rate / a, braked for the rest; on the way the rate is 1/√2 beyond.
        assert added[within, 1, axis].max() == pytest.approx(rate / np.sqrt(2), abs=a * t[1])
        assert np.ptp(np.sign(added[t < (1 + np.sqrt(0.5)) * rate / a - 1e-9, 2, axis])) == 0
    np.testing.assert_array_equal(
        motion.sample(np.zeros(1))[0, :2], sharp.sample(np.zeros(1))[0, :2] * [[1], [0]]
    )


def test_a_corner_needs_room_to_the_start_and_to_the_next_of_its_axis():
    # Half of the blend lies before the corner: 0.1 rad/s at 0.01 s needs 5 rad/s², and nothing else is there.
    corner = Corners(np.array([0.01]), np.zeros((1, 3)), np.array([[0.1, 0.0, 0.0]]))
    assert least_acceleration(np.zeros(3), corner) == pytest.approx(5.0)
    # α steps at 1 s and β at 1.001 s: each may take its time.
    corners = Corners(np.array([1.0, 1.001]), np.array([[0.1, 0, 0], [0, 0.1, 0]]), np.zeros((2, 3)))
    assert least_acceleration(np.zeros(3), corners) == 0.0
    same = corners._replace(angle_rad=np.array([[0.1, 0, 0], [0.1, 0, 0]]))
    assert least_acceleration(np.zeros(3), same) == pytest.approx(4 * 0.1 / 0.001**2)


def test_smooth_motion_is_left_alone():
    t = np.linspace(0, 3, 31)
    sharp = np.random.default_rng(0).random((31, 3, 3))
    assert rounded(sharp, t, np.zeros(3), no_corners(), 1.0).tobytes() == sharp.tobytes()
