"""Scales of the currents: they follow the run, small currents and alternating ones are visible."""

import numpy as np
import pytest

from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.layout.view import CURRENT_MAP, CURRENT_RMS
from spheretwin.viz.recording.currents import colour_range
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.scene.meshes import COILS, CURRENT_SCALE
from tests.viz.recording.panels import layouts
from tests.viz.recording.recordings import session_and_facts, static, timed

TICKS, OPEN_GROUP, ALTERNATING = 800, 4, 7


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([0.4] * 100, 0.5),  # 0.44
        ([0.4] * 99 + [8.0], 0.5),  # one of a hundred has the full colour
        ([0.4] * 95 + [-7.0] * 5, 8.0),  # 7.7, and 10 is beyond the limit
        ([0.0, np.nan], 0.01),
        ([], 0.01),
    ],
)
def test_a_range_contains_most_values_and_ends_at_the_limit(values, expected):
    assert colour_range(np.array(values, dtype=float), 8.0) == pytest.approx(expected)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Recording of constructed currents: 0.4 A in all groups, none in one, a square wave in another."""
    path = tmp_path_factory.mktemp("currents") / "run.rrd"
    session, facts = session_and_facts()
    table = Table(session.signals, np.zeros((TICKS, width(session.signals))))
    table["t_s"][:] = 1e-3 * np.arange(TICKS)
    table["allocation_scale"][:] = 1.0
    table["current_A"][:] = 0.4
    table["current_A"][TICKS // 2 :, OPEN_GROUP] = 0.0
    table["current_A"][:, ALTERNATING] = np.where(np.arange(TICKS) // 2 % 2, -0.4, 0.4)  # 250 Hz
    with Recorder(session.actuator, session.signals, facts, path=path) as recorder:
        for first in range(0, TICKS, 97):
            recorder.write(table.rows(first, min(first + 97, TICKS)))
        recorder.finish("completed")
    return path


def colours(rows):
    """Colours of the groups at each time, (n, groups, 3), from packed ones."""
    packed = np.array([values for _, values in rows], dtype=np.uint32)
    return np.stack([packed >> 24, packed >> 16 & 255, packed >> 8 & 255], axis=-1)


def test_coils_have_the_colours_of_the_range_of_the_run(path):
    rows = timed(path, COILS, "Mesh3D:albedo_texture_buffer")
    assert len(rows) == TICKS * 60 // 1000  # frames
    last = np.frombuffer(bytes(rows[-1][1][0]), np.uint8).reshape(-1, 3)
    expected = theme.current_colours(np.array([0.4, 0.0]), 0.5)
    np.testing.assert_array_equal(last[[0, OPEN_GROUP]], expected)
    assert static(path, CURRENT_SCALE, "Points3D:labels") == ["-0.5 A", "0, limit 8 A", "+0.5 A"]
    (ends,) = static(path, CURRENT_SCALE, "BarChart:values")
    assert ends["buffer"] == [0.5, -0.5]


def test_maps_show_an_open_coil_and_an_alternating_current(path):
    mean, rms = (
        colours(timed(path, entity, "SeriesLines:colors"))[-1] for entity in (CURRENT_MAP, CURRENT_RMS)
    )
    full = theme.current_colours(np.array(0.4), 0.5)
    none = theme.current_colours(np.array(0.0), 0.5)
    np.testing.assert_array_equal(mean[[0, OPEN_GROUP, ALTERNATING]], [full, none, none])
    some, nothing = (theme.magnitude_colours(np.array(rms_A), 0.5) for rms_A in (0.4, 0.0))
    np.testing.assert_array_equal(rms[[0, OPEN_GROUP, ALTERNATING]], [some, nothing, some])


def test_titles_of_the_maps_state_range_and_limit(path):
    names = [
        values[0] for (_, name), values in layouts(path)[-1].items() if name == "ViewBlueprint:display_name"
    ]
    titles = {name[0] for name in names if name}
    assert {"mean currents, ±0.5 A; limit 8 A", "RMS currents, 0 to 0.5 A; limit 8 A"} <= titles
