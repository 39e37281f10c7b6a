"""Runs against tolerances: constructed differences, shifts in time, edges; the shipped gate."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin import cli
from spheretwin.analysis import review, tolerances
from spheretwin.analysis.tolerances import Tolerance, Tolerances, beyond, compare, exceeded, share_used
from spheretwin.models.telemetry.table import read_parquet
from tests.twin.analysis.runs import made_of, named, written

T = np.arange(200) * 1e-3
WAVE = np.stack([np.sin(40 * T), 2 + np.cos(40 * T)], axis=1)


def first(reference, values, **tolerance):
    allowed = Tolerances(signals={"x_rad": Tolerance(**tolerance)})
    return exceeded(made_of(reference), named(made_of(values), "other.rrd"), allowed)


def test_the_same_run_is_within_no_tolerance_at_all():
    assert first(WAVE, WAVE.copy()) == []


def test_where_and_by_how_much_an_absolute_tolerance_is_left():
    other = WAVE.copy()
    other[120:, 1] += 0.003
    other[150:, 0] -= 0.5
    assert first(WAVE, other, absolute=0.6) == []
    (place,) = first(WAVE, other, absolute=0.001)
    assert place[:3] == ("other.rrd", "x_rad", "β")
    # Rounding of numbers up to 3, some units in their last place.
    assert place.t_s == pytest.approx(0.120, abs=1e-12)
    assert place.by == pytest.approx(0.002, abs=1e-14)


def test_a_relative_tolerance_grows_with_the_reference():
    assert first(WAVE, 1.009 * WAVE, relative=0.01) == []
    (place,) = first(WAVE, 1.02 * WAVE, relative=0.01)
    assert place.by == pytest.approx(0.01 * 3.0, rel=1e-12)  # β begins at 3, α at 0
    assert place.t_s == 0.0


def test_a_review_compares_with_the_first_run(tmp_path):
    first_run, _ = written(tmp_path, "first", **{"duration": 0.05, "disturbance.load": 1.0})
    table, metadata = read_parquet(first_run)
    table["q_ref_rad"][:] = 1.0
    table.write_parquet(first_run, metadata)
    table["q_ref_rad"][:] = 2.0
    table.write_parquet(other := tmp_path / "other.parquet", metadata)
    (path := tmp_path / "half.toml").write_text("[signals.q_ref_rad]\nrelative = 0.5\n")
    reviewed = review.review(first_run, other, tolerance=str(path))
    ((used,),), ((place,),) = reviewed.tolerances, reviewed.exceeded
    # Twice the half of the first; of the other it would be all of it.
    assert (used.share, used.excess) == pytest.approx((2.0, 0.5))
    assert place.by == pytest.approx(0.5)


@pytest.mark.parametrize("ticks", [-3, -1, 1, 3])
def test_a_shift_in_time_is_within_as_much_and_no_less(ticks):
    wave = np.stack([np.sin(40 * (T - 0.1)), T], axis=1)
    shifted = np.stack([np.sin(40 * (T - 0.1 - ticks * 1e-3)), T - ticks * 1e-3], axis=1)
    inner = slice(3, -3)  # at both ends the reference does not say what would come
    allowed = Tolerance(time_s=abs(ticks) * 1e-3, absolute=1e-12)  # of rounding
    less = Tolerance(time_s=(abs(ticks) - 1) * 1e-3, absolute=1e-12)
    assert not beyond(wave, shifted, allowed, 1e-3)[inner].any()
    assert beyond(wave, shifted, less, 1e-3)[inner].any(axis=0).all()


numbers = st.floats(-1e6, 1e6, allow_subnormal=False)


@given(numbers, st.floats(0, 1e3), st.floats(0, 1), st.floats(0, 2))
def test_the_edge_itself_is_within_and_what_is_past_it_is_not(reference, absolute, relative, share):
    allowed = absolute + relative * abs(reference)
    tolerance = Tolerance(absolute=absolute, relative=relative)
    for sign in (-1, 1):
        edge = reference + sign * allowed
        past = np.nextafter(edge, sign * np.inf)
        value = reference + sign * share * allowed
        column = np.array([[edge], [past], [value]])
        over = beyond(np.full((3, 1), reference), column, tolerance, 1e-3)[:, 0]
        assert over[0] == 0 < over[1]
        assert (over[2] == 0) == (sign * value <= sign * edge)


@given(st.lists(numbers, min_size=1, max_size=30), st.data())
def test_a_window_is_what_its_definition_says(values, data):
    """Against a loop over every row's window."""
    n = len(values)
    reference = np.array(values)
    run = np.array(data.draw(st.lists(numbers, min_size=n, max_size=n)))
    ticks, absolute = data.draw(st.integers(0, 40)), data.draw(st.floats(0, 1e5))
    over = beyond(reference[:, None], run[:, None], Tolerance(absolute=absolute, time_s=ticks * 1e-3), 1e-3)
    for i in range(n):
        near = reference[max(0, i - ticks) : i + ticks + 1]
        low, high = (near - absolute).min(), (near + absolute).max()
        assert over[i, 0] == max(0.0, run[i] - high, low - run[i])


def test_gaps_are_the_same_only_as_gaps():
    with_gap = WAVE.copy()
    with_gap[50:60] = np.nan
    assert first(with_gap, with_gap.copy()) == []
    for reference, other in ((WAVE, with_gap), (with_gap, WAVE)):
        (place,) = first(reference, other, absolute=1e9)
        assert (place.t_s, place.by) == (0.05, np.inf)


@pytest.mark.parametrize(("mine", "other"), [(200, 150), (150, 200)])
def test_a_run_that_ends_elsewhere_is_never_within(mine, other):
    (place,) = first(WAVE[:mine], WAVE[:other], absolute=1e9)
    assert (place.t_s, place.by) == (0.15, np.inf)


# --- the shipped gate


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A run, and one with a little and with much more load."""
    folder = tmp_path_factory.mktemp("runs")
    loads = {"first": 1.0, "near": 1.0, "far": 1.5}
    return {
        name: written(folder, name, duration=0.2, **{"controller.law": "pd", "disturbance.load": load})
        for name, load in loads.items()
    }


@pytest.mark.parametrize("name", tolerances.shipped())
def test_a_shipped_gate_lets_the_same_run_pass_and_stops_another(runs, name, capsys):
    first, near, far = ([str(path) for path in runs[each]] for each in ("first", "near", "far"))
    assert cli.main(["review", first[0], near[1], "--tolerance", name, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["within_tolerance"], report["exceeded"]) == (True, [])
    assert cli.main(["review", first[1], near[0], far[0], "--tolerance", name, "--json"]) == 1
    printed = capsys.readouterr()
    report = json.loads(printed.out)
    assert report["within_tolerance"] is False
    assert {place["path"] for place in report["exceeded"]} == {far[0]}
    (line,) = printed.err.splitlines()
    assert "leaves its tolerance first at" in line


def test_the_earliest_violation_of_all_signals_comes_first():
    late, other = WAVE.copy(), made_of(WAVE)
    late[120:] += 1.0
    run = named(made_of(late), "other.rrd")
    run.table["t_s"][50:] += 1e-4
    allowed = Tolerances(signals={"x_rad": Tolerance(absolute=0.1), "t_s": Tolerance(absolute=1e-6)})
    assert [place.signal for place in exceeded(other, run, allowed)] == ["t_s", "x_rad"]


@given(st.lists(numbers, min_size=1, max_size=30), st.lists(numbers, min_size=1, max_size=30))
def test_the_share_of_a_tolerance_is_that_of_its_definition(reference, values):
    count = min(len(reference), len(values))
    a, b = (np.array(column[:count])[:, None] for column in (reference, values))
    tolerance = Tolerance(absolute=0.5, relative=0.1)
    expected = np.abs(b - a) / (0.5 + 0.1 * np.abs(a))
    share = share_used(a, b, tolerance, 1e-3)
    # The limits are sums of numbers up to 1e6 and 1e5: their rounding over the least tolerance of 0.5.
    assert share == pytest.approx(expected, rel=1e-9, abs=1e-9)
    over = beyond(a, b, tolerance, 1e-3) > 0
    assert np.all(share[over] >= 1)
    assert np.all(share[~over] <= 1 + 1e-9)


def test_a_shift_within_the_time_uses_nothing_and_none_is_exceeded_at_once():
    shifted = np.roll(WAVE, 2, axis=0)[2:-2]
    assert not share_used(WAVE[2:-2], shifted, Tolerance(time_s=0.002, absolute=1e-3), 1e-3)[2:].any()
    assert np.isinf(share_used(WAVE, WAVE + 1.0, Tolerance(), 1e-3)).all()


def test_each_signal_has_its_largest_share_and_its_largest_excess():
    other = WAVE.copy()
    other[120, 1] += 0.003
    other[150, 0] -= 0.005
    (within,) = compare(
        made_of(WAVE), made_of(other), Tolerances(signals={"x_rad": Tolerance(absolute=0.01)})
    )
    assert (within.signal, within.axis, within.excess) == ("x_rad", "α", 0.0)
    assert (within.share, within.t_s) == (pytest.approx(0.5, rel=1e-9), pytest.approx(0.150, abs=1e-12))
    (left,) = compare(made_of(WAVE), made_of(other), Tolerances(signals={"x_rad": Tolerance(absolute=0.001)}))
    assert (left.axis, left.t_s) == ("α", pytest.approx(0.150, abs=1e-12))
    assert (left.share, left.excess) == (pytest.approx(5.0, rel=1e-9), pytest.approx(0.004, rel=1e-9))
    (short,) = compare(made_of(WAVE), made_of(WAVE[:50]), Tolerances(signals={"x_rad": Tolerance()}))
    assert (short.share, short.t_s) == (np.inf, 0.05)
