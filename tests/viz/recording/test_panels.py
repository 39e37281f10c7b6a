"""Panels draw the data of the run: of constructed signals each tick, or the bounds and mean of each bin."""

import numpy as np
import pytest

from spheretwin.models.telemetry.signals import ANGLES, Signal, common_signals, width
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.view import TELEMETRY
from spheretwin.viz.quantities import QuantityRows, quantities_of
from spheretwin.viz.recording import plots
from spheretwin.viz.recording.recorder import Recorder
from tests.viz.recording.panels import panels, rows
from tests.viz.recording.recordings import session_and_facts

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


def record(path, table, rate_Hz):
    session, facts = session_and_facts(duration=3.0)
    with Recorder(session.actuator, table.signals, facts, path=path, rate_Hz=rate_Hz) as recorder:
        for first in range(0, TICKS, 97):
            recorder.write(table.rows(first, min(first + 97, TICKS)))
        recorder.finish(Status.COMPLETED)
    return session.actuator


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
