"""Plotted data of a recording: equal to their source with all peaks, for any chunks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rerun.chunk import RrdReader

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.status import QUIET_S, Status
from spheretwin.models.telemetry.table import Table
from spheretwin.provenance import facts_of
from spheretwin.session import Session
from spheretwin.simulation import simulate
from spheretwin.viz import theme
from spheretwin.viz.decimation import FIRST_CHUNK_S, TimeBins
from spheretwin.viz.layout.extents import SPANS, ExtentTracker, PlotChannel
from spheretwin.viz.layout.view import CURRENT_BARS, CURRENT_MAP, SUMMARY, TIMELINE, derived
from spheretwin.viz.quantities import Aggregation, QuantityRows, quantities_of
from spheretwin.viz.recording import plots
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.recording.status import LEVELS, LimitSpells, Summary

TICK_s = 1e-3


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run that begins at the current limit, and its recording."""
    path = tmp_path_factory.mktemp("drawn") / "run.rrd"
    fields = {"duration": 2.6, "plant.engine": "lagrangian", "disturbance.load": 2.0}
    scenario = scenarios.load("nutation", fields)
    session = Session(scenario)
    facts = facts_of(session.scenario)
    with Recorder(session.actuator, session.signals, facts, path=path) as recorder:
        finished = simulate(scenario, sinks=[recorder])
    return path, session, finished.telemetry


def read(path, entity, component):
    """Times in s and values of one component, in order."""
    times, values = [], []
    for chunk in RrdReader(path).stream().filter(content=f"/{entity}"):
        batch = chunk.to_record_batch()
        if component in batch.schema.names and TIMELINE in batch.schema.names:
            times += [each.total_seconds() for each in batch.column(TIMELINE).to_pylist()]
            values += batch.column(component).to_pylist()
    order = np.argsort(times, kind="stable")
    return np.array(times)[order], [values[place] for place in order]


def spans(t_s, rate_Hz):
    """Rows of each bin, by a slow copy: ticks that begin within it."""
    number = np.floor(np.round(t_s / TICK_s) * TICK_s * rate_Hz + 1e-9)
    return [np.flatnonzero(number == each) for each in np.unique(number)]


def test_every_derived_quantity_is_recorded_with_its_peaks(run):
    path, session, table = run
    given_rows = QuantityRows(table, table.rows(0, 1), session.actuator, 8.0)
    bins = spans(table["t_s"], plots.QUANTITY_RATE_Hz)
    for quantity in quantities_of({signal.name for signal in table.signals}):
        whole = quantity.values(given_rows)
        _, drawn = read(path, derived(quantity.name), "Scalars:scalars")
        if quantity.aggregation is Aggregation.BOTH:
            pairs = np.reshape(drawn, (len(bins), 2, quantity.size))
            least, greatest = pairs.min(axis=1), pairs.max(axis=1)
            np.testing.assert_array_equal(least, [whole[rows].min(axis=0) for rows in bins])
            np.testing.assert_array_equal(greatest, [whole[rows].max(axis=0) for rows in bins])
        else:
            of = {Aggregation.LEAST: np.min, Aggregation.GREATEST: np.max, Aggregation.MEAN: np.mean}[
                quantity.aggregation
            ]
            expected = [of(whole[rows], axis=0) for rows in bins]
            # Means are summed in another order.
            np.testing.assert_allclose(drawn, expected, rtol=1e-12, atol=1e-15)


def test_the_map_of_the_currents_has_their_colours(run):
    path, _, table = run
    bins = spans(table["t_s"], plots.CURRENT_MAP_RATE_Hz)
    peaks = np.array(
        [
            [row[np.argmax(np.abs(row))] for row in table["current_A"][rows].T]  # of each group
            for rows in bins
        ]
    )
    colours = theme.current_colours(peaks, 8.0).astype(np.int64)
    packed = (colours[..., 0] << 24) + (colours[..., 1] << 16) + (colours[..., 2] << 8) + 255
    for entity, component in ((CURRENT_MAP, "SeriesLines:colors"), (CURRENT_BARS, "LineStrips2D:colors")):
        times, drawn = read(path, entity, component)
        np.testing.assert_allclose(times, [table["t_s"][rows[0]] for rows in bins], atol=1e-9)  # whole ns
        np.testing.assert_array_equal(drawn, packed)
    _, rows = read(path, CURRENT_MAP, "Scalars:scalars")
    np.testing.assert_array_equal(rows, np.tile(np.arange(18), (len(bins), 1)))
    _, bars = read(path, CURRENT_BARS, "LineStrips2D:strips")
    heights = np.array(bars)[..., 1]  # (bins, groups, 2)
    np.testing.assert_array_equal(heights[..., 0], 0)
    # A bar is half a unit at the limit, upward, which is to lower values; single precision.
    np.testing.assert_allclose(-heights[..., 1], 0.5 * peaks / 8.0, atol=1e-7)


ROWS = 400


@given(st.integers(0, 2**32 - 1), st.sets(st.integers(1, ROWS - 1)), st.booleans())
def test_bins_are_the_same_whatever_the_chunks(seed, cuts, immediate):
    values = np.random.default_rng(seed).normal(size=(ROWS, 2))
    t_s = TICK_s * np.arange(ROWS)
    bins, found = TimeBins(25.0, immediate=immediate), []
    for first, last in zip([0, *sorted(cuts)], [*sorted(cuts), ROWS], strict=True):
        found.append(bins.add(t_s[first:last], values[first:last]))
    found.append(bins.flush())
    assert bins.flush() is None
    parts = [each for each in found if each]
    expected = spans(t_s, 25.0)
    for name, of in (("low", np.min), ("high", np.max)):
        drawn = np.concatenate([getattr(each, name) for each in parts])
        np.testing.assert_array_equal(drawn, [of(values[rows], axis=0) for rows in expected])
    extremes = np.concatenate([each.extremes() for each in parts])
    sizes = [np.abs(values[rows]).max(axis=0) for rows in expected]
    np.testing.assert_array_equal(np.abs(extremes), sizes)


def test_chunks_of_bins_grow_and_none_is_held_long():
    bins, handed_over = TimeBins(25.0), []
    for first in range(0, 60_000, 100):
        ready = bins.add(TICK_s * np.arange(first, first + 100), np.zeros((100, 1)))
        if ready:
            handed_over.append((1e-3 * (first + 100), len(ready.t_s)))
    assert len(handed_over) < 12
    last_s = 0.0
    for now_s, _ in handed_over:
        # Within two bins, of 40 ms, and a chunk of 100 ms.
        assert now_s - last_s <= max(FIRST_CHUNK_S, last_s / 2) + 0.2
        last_s = now_s


def rising(rows):
    t_s = TICK_s * np.arange(len(rows))
    whole = TimeBins(25.0, immediate=True)
    first, last = whole.add(t_s, rows), whole.flush()
    return [np.concatenate(each) for each in zip(first.pairs(), last.pairs(), strict=True)]


def test_a_steady_rise_or_fall_keeps_its_form():
    values = np.stack([np.arange(ROWS), -np.arange(ROWS)], axis=1).astype(np.float64)
    t_s, drawn = rising(values)
    np.testing.assert_allclose(drawn[:, 0], t_s / TICK_s, atol=1e-9)
    np.testing.assert_allclose(drawn[:, 1], -t_s / TICK_s, atol=1e-9)


LIMIT_SIGNALS = (
    Signal("t_s", "s", 1, "time"),
    Signal("allocation_scale", "1", 1, "share"),
    Signal("voltage_limited", "1", 2, "share of the period"),
)


def slow_spells(t_s, levels):
    """A slow copy: at each tick, what of the ticks of its spell so far held back most."""
    told, changes, level = 0, [], 0
    for tick in range(len(t_s)):
        ahead = (levels > 0) & (t_s >= t_s[tick])
        behind = (levels > 0) & (t_s < t_s[tick])
        last = t_s[behind].max(initial=-np.inf)
        following = t_s[ahead].min(initial=np.inf)
        if levels[tick]:
            level = max(level, levels[tick])
        elif following - last > QUIET_S and t_s[-1] - last > QUIET_S:
            level = 0
        if level != told:
            changes.append((t_s[tick], LEVELS[level]))
            told = level
    return changes


@given(st.lists(st.tuples(st.integers(1, 290), st.integers(1, 2)), max_size=5), st.sets(st.integers(1, 299)))
def test_times_at_a_limit_are_logged_once_for_any_chunks(limited, cuts):
    table = Table(LIMIT_SIGNALS, np.zeros((300, width(LIMIT_SIGNALS))))
    table["t_s"][:], table["allocation_scale"][:] = TICK_s * np.arange(300), 1.0
    levels = np.zeros(300, dtype=int)
    for tick, level in limited:
        levels[tick : tick + 3] = np.maximum(levels[tick : tick + 3], level)
    table["voltage_limited"][levels == 1, 1] = 0.3
    table["allocation_scale"][levels == 2] = 0.5
    spells, found = LimitSpells(), []
    for first, last in zip([0, *sorted(cuts)], [*sorted(cuts), 300], strict=True):
        found += spells.of(table.rows(first, last))
    assert found == slow_spells(table["t_s"], levels)


def test_the_tracker_keeps_all_bounds_in_bounded_memory():
    survey, generator = ExtentTracker({"a": 1, "b": 2}), np.random.default_rng(0)
    values = generator.normal(size=(20 * SPANS, 3))
    for first in range(0, len(values), 100):
        part = values[first : first + 100]
        survey.add(0.04 * np.arange(first, first + 100), part - 1, part + 1)
    seen = survey.extents(None)
    assert SPANS <= len(seen.t_s) <= 2 * SPANS
    assert np.all(np.diff(seen.t_s) > 0)
    low, high = seen.bounds(PlotChannel("b", 1))
    assert (low, high) == (values[:, 2].min() - 1, values[:, 2].max() + 1)
    assert ExtentTracker({"a": 1}).extents(None) is None


def test_the_line_of_a_run_says_what_it_is_and_how_good(run):
    path, session, table = run
    for chunk in RrdReader(path).stream().filter(content=f"/{SUMMARY}"):
        batch = chunk.to_record_batch()
        told = batch.column("TextDocument:text").to_pylist()[-1][0]
    for text in ("**nutation** under **afsm**", "m = 0.2", "L = 2", "ideal hardware", "completed", "°**"):
        assert text in told
    summary = Summary(facts_of(session.scenario))
    assert "running" in summary.running()
    assert "left workspace" in summary.ended(Status.LEFT_WORKSPACE)
    summary.add(table.rows(0, 4), np.array([1.0, 7.0, 5.0, 5.0]))
    line = summary.ended(Status.LEFT_WORKSPACE)
    assert "**left workspace** at 0.003 s of 2.6 s; error largest **7°**, RMS **5°**" in line
