"""Markers of the runs in merged recordings: on the line, distinct, and the same in the legend."""

import numpy as np
import pytest

from spheretwin.viz.comparison import merged_recording
from tests.viz.comparison.compared import RAMP, T_s, run_of
from tests.viz.comparison.test_lines import Sent

RUNS = 8


def marks_of(place, values=RAMP, count=RUNS):
    sent, run = Sent(), run_of(values, label=f"{place + 1} run")
    merged_recording._send_marks(sent, "x", run, values, (1, 2, 3), (place, count))
    ((_, (look,), _),) = sent.static
    shape = look.markers.as_arrow_array().to_pylist()
    colours = look.colors.as_arrow_array().to_pylist()
    assert colours == [0x010203FF]
    return shape, *(sent.rows[0] if sent.rows else (None, None))


@pytest.mark.parametrize("place", range(RUNS))
def test_they_are_on_the_line_over_the_whole_run(place):
    _, t_ns, values = marks_of(place)
    np.testing.assert_array_equal(values, RAMP[np.round(t_ns / 1e6).astype(int)])  # a row a millisecond
    assert len(t_ns) == 12
    spacing_s = np.diff(t_ns) / 1e9
    np.testing.assert_allclose(spacing_s, T_s[-1] / 12, atol=2e-3)
    assert t_ns[0] / 1e9 < T_s[-1] / 12


def test_no_two_runs_have_one_shape_or_one_time():
    marks = [marks_of(place) for place in range(RUNS)]
    assert len({tuple(shape) for shape, _, _ in marks}) == RUNS
    times = np.concatenate([t_ns for _, t_ns, _ in marks])
    assert len(set(times)) == len(times)


def test_a_value_that_is_no_number_has_no_mark_and_a_run_of_one_row_has_one():
    broken = np.where(T_s > 2.0, np.nan, RAMP)
    _, t_ns, values = marks_of(2, broken)
    assert np.isfinite(values).all()
    assert len(t_ns) == 6
    assert marks_of(2, np.full(len(T_s), np.nan))[1] is None
    assert len(marks_of(0, RAMP[:1])[1]) == 1


def test_outlines_of_the_legend_are_the_markers():
    """In the view y points down."""
    shapes = [str(shape) for shape in merged_recording._OUTLINES]
    assert shapes == ["Circle", "Diamond", "Square", "Up", "Down", "Left", "Right"]
    corners = [merged_recording._outline(place) for place in range(8)]
    for of_one in corners[:7]:
        np.testing.assert_allclose(of_one[0], of_one[-1], atol=1e-12)
        np.testing.assert_allclose(np.hypot(*of_one.T), 1.0)
    assert [len(of_one) - 1 for of_one in corners[:7]] == [24, 4, 4, 3, 3, 3, 3]
    for place, tip in {3: [0, -1], 4: [0, 1], 5: [-1, 0], 6: [1, 0], 1: [1, 0]}.items():
        np.testing.assert_allclose(corners[place][0], tip, atol=1e-12)
    np.testing.assert_allclose(np.abs(corners[2]), np.sqrt(0.5))
    assert sorted(map(tuple, corners[7])) == [(-1, 0), (0, -1), (0, 0), (0, 1), (1, 0)]
