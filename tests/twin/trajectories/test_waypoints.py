"""Waypoints: the path between poses against its own definition, its peaks, its limits, and its file."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.csv_series import TimeSeries
from spheretwin.trajectories.waypoints import WaypointPath, Waypoints

HEADER = "t_s,alpha_rad,beta_rad,gamma_rad"
T = np.array([0.5, 1.25, 3.0, 4.5])
POSES = np.array([[0.0, 0.0, 0.0], [0.2, -0.1, 1.0], [0.1, 0.3, -1.0], [0.0, 0.0, 0.5]])
KINDS = ("minimum_jerk", "cubic")


def written(path, t=T, poses=POSES):
    np.savetxt(path, np.column_stack([t, poses]), fmt="%.17g", delimiter=",", header=HEADER, comments="")
    return str(path)


@pytest.fixture
def file(tmp_path):
    return written(tmp_path / "poses.csv")


@st.composite
def some_poses(draw):
    gaps = draw(st.lists(st.floats(0.01, 3), min_size=1, max_size=6))
    angle = st.floats(-2, 2)
    poses = draw(st.lists(st.tuples(angle, angle, angle), min_size=len(gaps) + 1, max_size=len(gaps) + 1))
    return TimeSeries(np.cumsum([draw(st.floats(-1, 1)), *gaps]), np.array(poses))


@pytest.mark.parametrize("between", KINDS)
@given(poses=some_poses())
def test_path_goes_through_the_poses_and_rests_beyond_them(between, poses):
    path, t = WaypointPath(poses, between), poses.t_s
    scale = 1 / np.diff(t).min()
    samples = path.sample(t)
    # Angles of 2 rad, and polynomials of them over the shortest time.
    np.testing.assert_allclose(samples[:, 0], poses.values, atol=1e-14)
    np.testing.assert_allclose(samples[[0, -1], 1], 0.0, atol=1e-13 * scale)
    beyond = path.sample(np.array([t[0] - 1, t[0] - 1e-6, t[-1], t[-1] + 1e6]))
    np.testing.assert_array_equal(beyond[:, 1:], 0.0)
    np.testing.assert_array_equal(beyond[:, 0], poses.values[[0, 0, -1, -1]])
    # Continuous up to the acceleration at poses in between; just before a pose against at it. Third
    # derivatives are below 60 · 4 rad over the shortest time cubed, and no spline swings ten times that.
    inner, early = t[1:-1], 1e-9 * np.diff(t)[:-1]
    apart = path.sample(inner - early) - path.sample(inner)
    for row in range(3):
        np.testing.assert_allclose(apart[:, row], 0.0, atol=3e-6 * scale**row)


@given(some_poses())
def test_minimum_jerk_solves_the_conditions_of_rest_at_both_ends(poses):
    path = WaypointPath(poses, "minimum_jerk")
    for i, lasts in enumerate(np.diff(poses.t_s)):
        # The extremal of ∫ jerk² is a polynomial of degree five; here its six conditions are solved anew.
        powers = np.arange(6)
        end = [np.ones(6), powers, powers * (powers - 1)]
        conditions = np.vstack([np.diag([1.0, 1.0, 2.0, 0, 0, 0])[:3], end])
        right = np.zeros((6, 3))
        right[0], right[3] = poses.values[i], poses.values[i + 1]
        polynomial = np.linalg.solve(conditions, right)
        share = np.linspace(0, 1, 21)[1:-1]
        expected = (share[:, None] ** powers) @ polynomial
        sampled = path.sample(poses.t_s[i] + lasts * share)[:, 0]
        np.testing.assert_allclose(sampled, expected, atol=1e-12)  # condition number 1e3


def test_cubic_is_the_clamped_spline():
    path = WaypointPath(TimeSeries(T, POSES), "cubic")
    # A piecewise cubic of two continuous derivatives with given poses and end rates is the only one: fourth
    # differences within a segment vanish, the rest is checked above.
    for start, end in pairwise(T):
        angle = path.sample(np.linspace(start, end, 9)[1:-1])[:, 0]
        np.testing.assert_allclose(np.diff(angle, 4, axis=0), 0.0, atol=1e-14)
    # Through two poses alone it is Hermite's 3 u² - 2 u³.
    share = np.linspace(0, 0.999, 11)
    two = WaypointPath(TimeSeries(T[:2], POSES[:2]), "cubic").sample(T[0] + 0.75 * share)[:, 0, 2]
    np.testing.assert_allclose(two, 3 * share**2 - 2 * share**3, atol=1e-15)


@pytest.mark.release("1.4 s; test_path_goes_through_the_poses_and_rests_beyond_them has the path")
@pytest.mark.parametrize("between", KINDS)
@given(poses=some_poses())
@example(poses=TimeSeries(T, np.zeros((4, 3))))
def test_peaks_are_the_largest_there_are(between, poses):
    path = WaypointPath(poses, between)
    t = np.concatenate([np.linspace(start, end, 400, endpoint=False) for start, end in pairwise(poses.t_s)])
    samples = np.abs(path.sample(t))
    for row, peak in zip((1, 2), path.peaks(), strict=True):
        largest = samples[:, row].max()
        # A polynomial turns at its peak, which lies within a 400th of a segment of some sample; where the
        # peak is at an end, what is missing is of the first order.
        assert largest <= peak.value * (1 + 1e-12)
        assert largest >= peak.value * (1 - 0.02)
        axis = ("alpha", "beta", "gamma").index(peak.axis)
        at = max(poses.t_s[0], np.nextafter(peak.t_s, -np.inf) - 1e-12)  # from the last pose on is rest
        reached = abs(path.sample(np.array([at]))[0, row, axis])
        np.testing.assert_allclose(reached, peak.value, rtol=1e-6, atol=1e-12)


def test_minimum_jerk_has_the_known_peaks(tmp_path):
    file = written(tmp_path / "one.csv", T[:2], [[0, 0, 0], [0.1, -0.4, 0.0]])
    rate, acceleration = Waypoints(file=file).peaks()
    assert (rate.value, rate.t_s) == (pytest.approx(15 / 8 * 0.4 / 0.75), pytest.approx(0.875))
    assert rate.axis == "beta"
    assert acceleration.value == pytest.approx(10 / np.sqrt(3) * 0.4 / 0.75**2)
    assert acceleration.axis == "beta"
    assert acceleration.t_s == pytest.approx(0.5 + 0.75 * (0.5 - np.sqrt(1 / 12)))


@pytest.mark.parametrize("between", KINDS)
def test_limits_are_kept_or_told(file, between):
    rate, acceleration = Waypoints(file=file, between=between).peaks()
    limits = {"largest_rate_rad_s": rate.value, "largest_acceleration_rad_s2": acceleration.value}
    assert Waypoints(file=file, between=between, **limits).peaks() == (rate, acceleration)
    texts = "largest rate of 1 rad/s, received", "largest acceleration of 1 rad/s², received"
    for field, peak, words in zip(limits, (rate, acceleration), texts, strict=True):
        with pytest.raises(InputError) as refusal:
            Waypoints(file=file, between=between, **{field: 1.0})
        message = str(refusal.value)
        assert message.startswith(f"waypoints {file}: expected a {words} {peak.value:g}")
        assert message.endswith(f"on {peak.axis} at {peak.t_s:g} s")
        with pytest.raises(InputError, match="expected a largest"):
            Waypoints(file=file, between=between, **{field: peak.value * (1 - 1e-12)})


def test_an_edit_of_the_file_changes_no_path_that_is_made(tmp_path, file):
    t = np.linspace(0, 5, 51)
    made, twin = Waypoints(file=file), Waypoints(file=file)
    before = made.sample(t).tobytes()
    written(tmp_path / "poses.csv", T, POSES + 0.1)
    assert made.sample(t).tobytes() == before
    copied = made.model_copy(update={"largest_rate_rad_s": 9.0})
    assert copied.sample(t).tobytes() == before
    assert made == twin
    assert Waypoints(file=file) != made
    (tmp_path / "poses.csv").unlink()
    assert made.sample(t).tobytes() == before
