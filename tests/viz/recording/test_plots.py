"""Plotted data of a recording: equal to their source with all peaks, for any chunks."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.status import QUIET_S, Status
from spheretwin.viz.decimation import FIRST_CHUNK_S, TimeBins
from spheretwin.viz.layout.view import ONSETS
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.recording.status import LEVELS, LimitSpells
from spheretwin.viz.recording.summary import Summary
from tests.viz.recording.panels import layouts
from tests.viz.recording.recordings import session_and_facts, timed
from tests.viz.tables import chunks, table_of

TICK_s = 1e-3

OPEN = {"target": "coil.00", "mode": "open", "start_s": 0.02}


def spans(t_s, rate_Hz):
    """Rows of each bin, by a slow copy: ticks that begin within it."""
    number = np.floor(np.round(t_s / TICK_s) * TICK_s * rate_Hz + 1e-9)
    return [np.flatnonzero(number == each) for each in np.unique(number)]


ROWS = 400


@given(st.integers(0, 2**32 - 1), st.sets(st.integers(1, ROWS - 1)), st.booleans())
def test_bins_are_the_same_whatever_the_chunks(seed, cuts, immediate):
    values = np.random.default_rng(seed).normal(size=(ROWS, 2))
    t_s = TICK_s * np.arange(ROWS)
    bins, results = TimeBins(25.0, immediate=immediate), []
    for first, last in zip([0, *sorted(cuts)], [*sorted(cuts), ROWS], strict=True):
        results.append(bins.add(t_s[first:last], values[first:last]))
    results.append(bins.flush())
    assert bins.flush() is None
    parts = [each for each in results if each]
    expected = spans(t_s, 25.0)
    for name, of in (("low", np.min), ("high", np.max)):
        drawn = np.concatenate([getattr(each, name) for each in parts])
        np.testing.assert_array_equal(drawn, [of(values[rows], axis=0) for rows in expected])
    means = np.concatenate([each.mean for each in parts])
    # Sums in another order.
    np.testing.assert_allclose(
        means, [values[rows].mean(axis=0) for rows in expected], rtol=1e-12, atol=1e-15
    )


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


LIMIT_SIGNALS = (
    Signal("t_s", "s", 1, "time"),
    Signal("allocation_scale", "1", 1, "share"),
    Signal("voltage_limited", "1", 2, "share of the period"),
)


def slow_spells(t_s, levels):
    """A slow copy: at each tick, what of the ticks of its spell so far held back most."""
    reported_s, changes, level = 0, [], 0
    for tick in range(len(t_s)):
        ahead = (levels > 0) & (t_s >= t_s[tick])
        behind = (levels > 0) & (t_s < t_s[tick])
        last = t_s[behind].max(initial=-np.inf)
        following = t_s[ahead].min(initial=np.inf)
        if levels[tick]:
            level = max(level, levels[tick])
        elif following - last > QUIET_S and t_s[-1] - last > QUIET_S:
            level = 0
        if level != reported_s:
            changes.append((t_s[tick], LEVELS[level]))
            reported_s = level
    return changes


@given(st.lists(st.tuples(st.integers(1, 290), st.integers(1, 2)), max_size=5), st.sets(st.integers(1, 299)))
def test_times_at_a_limit_are_logged_once_for_any_chunks(limited, cuts):
    table = table_of(LIMIT_SIGNALS, TICK_s * np.arange(300), allocation_scale=1.0)
    levels = np.zeros(300, dtype=int)
    for tick, level in limited:
        levels[tick : tick + 3] = np.maximum(levels[tick : tick + 3], level)
    table["voltage_limited"][levels == 1, 1] = 0.3
    table["allocation_scale"][levels == 2] = 0.5
    spells = LimitSpells()
    results = [change for rows in chunks(table, cuts) for change in spells.of(rows)]
    assert results == slow_spells(table["t_s"], levels)


FAULT_SIGNALS = (
    Signal("t_s", "s", 1, "time"),
    Signal("q_rad", "rad", 3, "angles"),
    Signal("allocation_scale", "1", 1, "share"),
    Signal("fault", "1", 3, "faults", ("coil.00", "coil.01", "encoder.gamma"), ("none", "open", "shorted")),
    Signal("group_out", "1", 2, "groups", ("group 0", "group 1"), ("in use", "reported", "found open")),
    Signal("time_to_detection_s", "s", 2, "time to detection", ("group 0", "group 1")),
    Signal("failsafe_reason", "1", 1, "reason", (), ("nothing", "a coil is too hot")),
)


@pytest.fixture(scope="module")
def facts_with_faults():
    faults = [OPEN, {**OPEN, "target": "coil.02"}, {**OPEN, "target": "coil.01"}]
    return session_and_facts(duration=3.0, fault=faults)[1]


@given(st.sets(st.integers(1, 99)))
def test_the_headline_names_each_fault_its_start_and_its_detection(facts_with_faults, cuts):
    at_s = TICK_s * np.arange(100)
    table = table_of(FAULT_SIGNALS, at_s, allocation_scale=1.0, time_to_detection_s=-1.0)
    table["fault"][20:, 1], table["fault"][40:60, 0] = 2, 1
    table["time_to_detection_s"][25:, 1], table["group_out"][25:, 1] = 0.005, 2
    table["failsafe_reason"][90:] = 1
    summary = Summary(facts_with_faults)
    for rows in chunks(table, cuts):
        summary.add(rows, np.zeros(len(rows)))
    headline, reason, _, faults, chosen = summary.ended(Status.FAILSAFE).split("  \n")
    assert headline.startswith("**✗ FAILSAFE · hold")
    assert reason == "**failsafe at 0.100 s of 3 s: a coil is too hot**"
    assert faults == (
        "faults: coil.01 shorted from 0.02 s, detected after 5 ms; coil.00 open from 0.04 s to 0.06 s,"
        " not detected;"
        " 1 of 3 planned faults did not start"
    )
    assert chosen.startswith("chosen: trajectory.shape hold · ")
    for stated in ("fault.", "controller.law", "hardware", "disturbance.load"):
        assert stated not in chosen


def test_the_headline_names_the_file_whose_run_is_replayed(facts_with_faults):
    facts = replace(facts_with_faults, replay_of="run.parquet")
    assert Summary(facts).running().startswith("**▶ RUNNING · replay of run.parquet · hold under ")
    assert "replay" not in Summary(facts_with_faults).running()


@pytest.mark.parametrize(("faults", "times_s"), [([], []), ([OPEN], [0.02, 0.06])])
def test_the_start_of_each_fault_is_a_line_in_every_plot_over_time(tmp_path, faults, times_s):
    path, (session, facts) = tmp_path / "run.rrd", session_and_facts("hold", fault=faults)
    table = table_of(session.signals, TICK_s * np.arange(100), allocation_scale=1.0)
    if faults:
        table["fault"][20:40, 0] = table["fault"][60:, 0] = 1
    with Recorder(session.actuator, session.signals, facts, path=path) as recorder:
        recorder.write(table)
        recorder.finish("completed")
    first_ms = [timed(path, f"{ONSETS}/{place}", "Scalars:scalars")[0][0] for place in range(len(times_s))]
    assert first_ms == [round(1e3 * t_s) for t_s in times_s]
    layout = layouts(path)[-1]
    plots = {entity.rpartition("/")[0] for entity, name in layout if name.startswith("ScalarAxis:")}
    assert len(plots) > 8
    queries = [layout[f"{plot}/ViewContents", "ViewContents:query"][-1] for plot in plots]
    assert {f"/{ONSETS}/**" in query for query in queries} == {bool(faults)}
