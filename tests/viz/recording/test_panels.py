"""Panels draw the data of the run: of constructed signals each tick, or the bounds and mean of each bin."""

import numpy as np
import pytest
from rerun.components import AggregationPolicy, InterpolationMode, MarkerShape

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.signals import ANGLES, Signal, common_signals, width
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.provenance import facts_of
from spheretwin.session import Session
from spheretwin.viz import theme
from spheretwin.viz.layout.view import CURRENT_LIMITS, CURRENT_MAP, CURRENT_VARIATION, TELEMETRY
from spheretwin.viz.quantities import QuantityRows, quantities_of
from spheretwin.viz.recording import currents, plots
from spheretwin.viz.recording.reader import rewrite
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.scene.meshes import COILS
from tests.viz.recording.panels import columns, panels, rows, style

TICK_s, TICKS, LIMIT_A = 1e-3, 3000, 8.0

SPIKE = 1234

OWN = (
    Signal("q_measured_rad", "rad", 3, "measured angles", ANGLES),
    Signal("qdot_estimated_rad_s", "rad/s", 3, "estimated rates", ANGLES),
    Signal("sliding_s", "rad/s", 3, "sliding variables", ANGLES),
    Signal("voltage_limited", "1", 18, "share of the time", tuple(f"group {i}" for i in range(18))),
)


def shapes(size):
    """A 250 Hz square wave, a spike of one tick and a slow ramp in turn, of different heights, (n, size)."""
    tick = np.arange(TICKS)
    forms = [np.where(tick // 2 % 2, 1.0, -1.0), np.where(tick == SPIKE, 1.0, 0.0), tick / TICKS]
    return np.stack([forms[i % 3] * (1 + i) / size for i in range(size)], axis=1)


@pytest.fixture(scope="module")
def table():
    signals = (*common_signals(18), *OWN)
    table = Table(signals, np.zeros((TICKS, width(signals))))
    for place, signal in enumerate(signals):
        block = table[signal.name].reshape(TICKS, -1)
        # Neighbours have other shapes in the same column.
        block[:] = 0.2 * np.roll(shapes(signal.size + 2), place, axis=1)[:, : signal.size]
    table["t_s"][:] = TICK_s * np.arange(TICKS)
    table["error_rad"][:] = table["q_rad"] - table["q_ref_rad"]
    table["allocation_scale"][:] = 1.0
    table["current_A"][:] = LIMIT_A * shapes(18)
    return table


def record(path, table, rate_Hz, status=Status.COMPLETED, rows_at_once=97):
    scenario = scenarios.load("hold", {"duration": 3.0})
    with Session(scenario) as session:
        facts, actuator = facts_of(session.initial_scenario), session.actuator
    with Recorder(actuator, table.signals, facts, path=path, rate_Hz=rate_Hz) as recorder:
        for first in range(0, TICKS, rows_at_once):
            recorder.write(table.rows(first, min(first + rows_at_once, TICKS)))
        recorder.finish(status)
    return actuator


@pytest.fixture(scope="module", params=[None, 60.0], ids=["every row", "60 Hz"])
def recording(request, table, tmp_path_factory):
    path = tmp_path_factory.mktemp("panels") / "run.rrd"
    actuator = record(path, table, request.param)
    given = QuantityRows(table, table.rows(0, 1), actuator, LIMIT_A)
    names = {signal.name for signal in table.signals}
    plotted = {quantity.name: quantity.values(given) for quantity in quantities_of(names)}
    plotted |= {signal.name: table[signal.name].reshape(TICKS, -1) for signal in table.signals}
    return path, request.param, plotted


def bins_of(rate_Hz):
    """Rows of each bin of time, by a slow copy."""
    number = np.array([int(tick * TICK_s * rate_Hz + 1e-9) for tick in range(TICKS)])
    return [np.flatnonzero(number == each) for each in range(number[-1] + 1)]


def ticks(t_ns):
    return np.round(t_ns * 1e-6).astype(int)


def test_every_line_is_the_signal_at_each_tick_or_its_bounds_in_each_bin(recording):
    path, rate_Hz, plotted = recording
    bins = bins_of(plots.ENVELOPE_RATE_Hz)
    lines = {
        (line.entity, line.component, line.name)
        for panel in panels(path)
        for line in panel.lines
        if line.visualizer == "SeriesLines"
    }
    assert {name for _, _, name in lines} >= {
        "error_mrad",
        "torque_delivered_Nm",
        "torque_command_Nm",
        "q_rad",
    }
    for entity, component, name in sorted(lines):
        t_ns, drawn = rows(path, entity, component, name)
        whole = plotted[name]
        if rate_Hz is None:
            expected = whole if entity == TELEMETRY else whole.astype(np.float32)
            np.testing.assert_array_equal(ticks(t_ns), np.arange(TICKS))
            np.testing.assert_array_equal(drawn, expected)
            continue
        # The last bin is drawn twice: from its first row to the end of the run.
        starts = [part[0] for part in bins] + [TICKS - 1]
        np.testing.assert_array_equal(ticks(t_ns), starts)
        low, mean, high = np.split(drawn, 3, axis=1)
        parts = [*bins, bins[-1]]
        np.testing.assert_array_equal(low, np.array([whole[part].min(axis=0) for part in parts], np.float32))
        np.testing.assert_array_equal(high, np.array([whole[part].max(axis=0) for part in parts], np.float32))
        # Summed in another order, and in single precision at last.
        means = [whole[part].mean(axis=0) for part in parts]
        np.testing.assert_allclose(mean, means, rtol=1e-6, atol=1e-9)


def test_all_lines_share_one_reduction(recording):
    path, rate_Hz, plotted = recording
    for panel in panels(path):
        for line in panel.lines:
            look = style(path, line.entity, line.name)
            assert look["aggregation_policy"] == [AggregationPolicy.MinMax.value]  # all values of a pixel
            mode = line.look.get("SeriesLines:interpolation_mode")
            size = plotted[line.name].shape[1]
            if rate_Hz is None:
                assert mode is None
                assert len(look["names"]) == size
                continue
            assert mode == [InterpolationMode.StepAfter.value]  # to the end of the bin
            assert len(look["names"]) == 3 * size
            low, mean, high = np.split(np.array(look["widths"]), 3)
            assert np.all(low < mean)
            assert np.all(high < mean)
            assert panel.shown is None or panel.shown == panel.shown[:3] * 3


MARKERS = {"●": MarkerShape.Circle, "×": MarkerShape.Cross, "+": MarkerShape.Plus}


def test_lines_that_share_a_panel_have_a_legend_or_a_key_and_markers_on_the_signal(recording):
    path, _, plotted = recording
    values, times = columns(path)
    several = 0
    for panel in panels(path):
        names = sorted({line.name for line in panel.lines})
        few = [name for name in names if plotted[name].shape[1] <= 3]
        (entity,) = [entity for entity in panel.entities if entity.startswith("/marks/")] or [None]
        several_lines = sum(plotted[name].shape[1] for name in names) > 1  # a title names one line
        has_legend = several_lines and names == few and panel.shown is None and "●" not in panel.title
        assert panel.legend == has_legend, panel.title
        if not (len(few) > 1 or any(plotted[name].shape[1] == 3 for name in few)):
            assert entity is None, panel.title
            continue
        several += 1
        look = {
            name: values[entity, f"SeriesPoints:{name}"][0].to_pylist()[0]
            for name in ("names", "colors", "markers")
        }
        styles = [
            style(path, line.entity, line.name) for name in few for line in panel.lines if line.name == name
        ]
        by_name = {
            name: colour for of in styles for name, colour in zip(of["names"], of["colors"], strict=True)
        }
        assert dict(zip(look["names"], look["colors"], strict=True)) == by_name
        whole = np.concatenate([plotted[name] for name in few], axis=1)
        key = entity, "Scalars:scalars"
        marks = np.array([row for column in values[key] for row in column.to_pylist()])
        ticks_shown = ticks(np.concatenate(times[key]))
        assert len(ticks_shown) == pytest.approx(3 * plots.MARKS_OF_A_LINE, abs=1)
        there = np.isfinite(marks)
        assert np.all(there.sum(axis=0) >= plots.MARKS_OF_A_LINE - 1)
        np.testing.assert_array_equal(marks[there], whole[ticks_shown][there])
        if panel.shown is None:
            continue
        # The title says which line has which marker; no two of them have one at the same time.
        shown = np.array(panel.shown[:3] * len(few))
        assert panel.marked == shown.tolist()
        assert there[:, shown].sum(axis=1).max() == 1
        stated = {marker for glyph, marker in MARKERS.items() if f"{glyph} " in panel.title}
        assert stated <= {
            MarkerShape(marker) for marker, one in zip(look["markers"], shown, strict=True) if one
        }
    assert several > 5


def test_axes_that_share_a_panel_have_markers_of_their_own(recording):
    path, _, _ = recording
    values, _ = columns(path)
    for panel in panels(path):
        if panel.title.startswith(("error of each", "sliding", "measured", "coupling")):
            (entity,) = [entity for entity in panel.entities if entity.startswith("/marks/")]
            markers = values[entity, "SeriesPoints:markers"][0].to_pylist()[0]
            assert len(set(markers)) == 3, panel.title


def test_each_panel_of_a_hinge_shows_its_own_entries(recording):
    path, _, _ = recording
    shown = {panel.title: panel.shown for panel in panels(path) if panel.shown}
    assert len(shown) == 6
    for title, entries in shown.items():
        (hinge,) = (name for name in ANGLES if name in title)
        assert entries[:3] == [name == hinge for name in ANGLES], title


def test_ranges_and_titles_hold_the_largest_values(recording):
    path, _, plotted = recording
    by_title = {panel.title: panel for panel in panels(path)}
    (title,) = {title for title in by_title if title.startswith("error of each")}
    assert f"largest {np.abs(plotted['error_mrad']).max():.3g}" in title
    for place, name in enumerate(ANGLES):
        torques = [
            plotted[of][:, place] for of in ("torque_delivered_Nm", "torque_command_Nm", "disturbance_Nm")
        ]
        (title,) = (title for title in by_title if title.startswith(f"{name}: ●coils"))
        assert f"largest {np.abs(torques).max():.3g}" in title
        angles = np.concatenate([plotted[of][:, place] for of in ("q_rad", "q_ref_rad", "q_measured_rad")])
        (title,) = (title for title in by_title if title.startswith(f"{name}: ● actual"))
        low, high = by_title[title].band
        assert low <= angles.min() < angles.max() <= high
        stated = [float(text) for text in title.partition("[rad], ")[2].split(" to ")]
        np.testing.assert_allclose(stated, [angles.min(), angles.max()], atol=0.01 * np.ptp(angles))


def test_coils_and_bars_are_the_row_at_the_cursor(recording, table):
    path, rate_Hz, _ = recording
    values, times = columns(path)
    key = f"/{COILS}", "BarChart:values"
    bars = [tensor["buffer"] for column in values[key] for (tensor,) in column.to_pylist()]
    t_ns = np.concatenate(times[key])
    expected = np.arange(TICKS) if rate_Hz is None else [part[0] for part in bins_of(60.0)]
    order = np.argsort(t_ns, kind="stable")
    np.testing.assert_array_equal(ticks(t_ns[order]), expected)
    # Half precision keeps three digits.
    np.testing.assert_allclose(np.array(bars)[order], table["current_A"][expected], rtol=2**-11, atol=1e-7)
    texture = f"/{COILS}", "Mesh3D:albedo_texture_buffer"
    colours = np.array(
        [
            np.frombuffer(bytes(texel), np.uint8)
            for column in values[texture]
            for (texel,) in column.to_pylist()
        ]
    )
    of_rows = theme.current_colours(table["current_A"][expected], LIMIT_A).reshape(len(expected), -1)
    np.testing.assert_array_equal(colours[np.argsort(np.concatenate(times[texture]), kind="stable")], of_rows)


def test_bars_have_the_limit_as_their_scale(recording):
    path, _, _ = recording
    values, _ = columns(path)
    (ends,) = values[f"/{CURRENT_LIMITS}", "BarChart:values"][0].to_pylist()[0]
    assert ends["buffer"] == [LIMIT_A, -LIMIT_A]
    assert values[f"/{CURRENT_LIMITS}", "BarChart:widths"][0].to_pylist()[0] == [0.0, 0.0]
    (places,) = values[f"/{COILS}", "BarChart:abscissa"][0].to_pylist()[0]
    widths = values[f"/{COILS}", "BarChart:widths"][0].to_pylist()[0]
    np.testing.assert_allclose(np.array(places["buffer"]) + np.array(widths) / 2, np.arange(18), atol=1e-6)


def packed(colours):
    return [[int.from_bytes(bytes([*colour, 255]), "big") for colour in row] for row in colours.tolist()]


def test_the_map_is_the_mean_of_each_cell_and_its_lane_the_deviation(recording, table):
    path, _, _ = recording
    bins = bins_of(currents.CURRENT_MAP_RATE_Hz)
    cells = [*bins, bins[-1]]  # up to the end of the run
    mean = np.array([table["current_A"][part].mean(axis=0) for part in cells])
    deviation = np.array([np.sqrt(table["current_A"][part].var(axis=0).mean()) for part in cells])
    for entity, expected in (
        (CURRENT_MAP, theme.current_colours(mean, LIMIT_A)),
        (CURRENT_VARIATION, theme.variation_colours(deviation[:, None], LIMIT_A)),
    ):
        values, times = columns(path)
        key = f"/{entity}", "SeriesLines:colors"
        order = np.argsort(np.concatenate(times[key]), kind="stable")
        drawn = [row for column in values[key] for row in column.to_pylist()]
        np.testing.assert_array_equal(
            ticks(np.concatenate(times[key])[order]), [part[0] for part in bins] + [TICKS - 1]
        )
        # A mean that is summed in another order may round to the next colour.
        difference = np.array([drawn[place] for place in order]) ^ np.array(packed(expected))
        assert np.mean(difference != 0) < 0.01
    square, zero = (
        theme.current_colours(mean[:, :1], LIMIT_A).astype(int),
        theme.current_colours(np.zeros(1), 1.0),
    )
    # A square wave has a mean near zero: its cells are neutral, and the lane shows that it is not calm.
    assert np.abs(square[2:-2] - zero).max() < 4
    assert deviation[2:-2].min() > 0.1 * LIMIT_A


def test_lines_of_a_run_that_ended_early_reach_its_end(table, tmp_path):
    for rate_Hz in (None, 60.0):
        path = tmp_path / f"{rate_Hz}.rrd"
        record(path, table, rate_Hz, Status.LEFT_WORKSPACE)
        for panel in panels(path):
            assert "/ended" in panel.entities
            for line in panel.lines:
                if line.visualizer == "SeriesLines":
                    t_ns, _ = rows(path, line.entity, line.component, line.name)
                    assert ticks(t_ns)[-1] == TICKS - 1


@pytest.mark.parametrize("rate_Hz", [None, 60.0], ids=["every row", "60 Hz"])
def test_a_recording_that_was_not_closed_is_recovered_with_its_whole_picture(table, tmp_path, rate_Hz):
    closed, cut, recovered = (tmp_path / f"{name}.rrd" for name in ("closed", "cut", "recovered"))
    record(closed, table, rate_Hz, Status.LEFT_WORKSPACE)
    end = len(closed.read_bytes())
    with Session(scenarios.load("hold", {"duration": 3.0})) as session:
        facts, actuator = facts_of(session.initial_scenario), session.actuator
    recorder = Recorder(actuator, table.signals, facts, path=cut, rate_Hz=rate_Hz)
    for first in range(0, TICKS, 97):
        recorder.write(table.rows(first, min(first + 97, TICKS)))
    part = recorder.partial()
    cut.write_bytes(part.path.read_bytes())
    recorder.close()
    assert cut.stat().st_size < end
    recorded = rewrite(cut, recovered)
    assert len(recorded.table) > (0.9 * TICKS if rate_Hz is None else 150)
    last = recorded.table["t_s"][-1]
    by_title = {panel.title.partition(",")[0].partition(" ±")[0]: panel for panel in panels(recovered)}
    for panel in panels(closed):
        again = by_title[panel.title.partition(",")[0].partition(" ±")[0]]
        assert again.shown == panel.shown
        assert [line[:4] for line in again.lines] == [line[:4] for line in panel.lines]
        assert set(again.entities) == set(panel.entities)
        if panel.band:  # of rows that end a little earlier
            np.testing.assert_allclose(again.band, panel.band, rtol=0.15, atol=1e-9)
    values, times = columns(recovered)
    text = values["/summary", "TextDocument:text"][-1].to_pylist()[0][0]
    headline, figures = text.split("  \n", 1)
    assert headline.startswith("**⚠ NOT CLOSED · hold under afsm")
    assert f"its rows end at {last:.3g} s of 3 s" in figures
    assert "largest" in figures
    marks = [entity for entity, name in values if entity.startswith("/marks/") and name == "Scalars:scalars"]
    assert len(marks) > 5
    marked_s = np.concatenate([t_ns for each in marks for t_ns in times[each, "Scalars:scalars"]]) * 1e-9
    assert marked_s.min() >= 0
    assert 0.5 * last < marked_s.max() <= last + 1e-6
    ended = np.concatenate(times["/ended", "Scalars:scalars"])
    assert abs(ended[0] * 1e-9 - last) < 1e-6
