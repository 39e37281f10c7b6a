"""Live view of a run: envelopes of all ticks, unchanged telemetry, no request to other machines."""

import os
import signal
import socket
import subprocess
import sys
import urllib.parse
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.signals import common_signals
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.records.outputs import Outputs
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.viz.layout.plots import Plots
from spheretwin.viz.layout.view import ENVELOPE, EVENTS, TELEMETRY, View
from spheretwin.viz.recording.live import RECORDING
from tests.browser import Browser, needs_a_browser
from tests.viz.recording.panels import columns
from tests.viz.recording.recordings import telemetry_of
from tests.waiting import wait_for

CHANGES = {"plant.engine": "lagrangian", "duration": 1.5, "plant.modelling_error": 0.2}


def flown(folder, name, live=True, watching=lambda address: None):
    """A run's telemetry; `watching` is called with the page's address before it, and halfway through."""
    telemetry = folder / f"{name}.parquet"
    with Session(scenarios.load("hold", CHANGES)) as session:
        files = Outputs(session, None, telemetry, live)
        address = files._live.address if live else None
        watching(address)
        half = session.scenario.ticks // 2
        follow(session, half, files.sinks, live=live)
        watching(address)
        follow(session, session.scenario.ticks, files.sinks, live=live)
        assert files.close() == []
    return telemetry


def asking(address):
    """A viewer that has asked for the recording."""
    parts = urllib.parse.urlsplit(address)
    viewer = socket.socket()
    viewer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)  # full after the first kilobytes
    viewer.connect((parts.hostname, parts.port))
    viewer.sendall(f"GET {RECORDING} HTTP/1.0\r\nHost: {parts.netloc}\r\n\r\n".encode())
    assert viewer.recv(12) == b"HTTP/1.0 200"
    return viewer


@pytest.fixture(scope="module")
def headless(tmp_path_factory):
    return read_parquet(flown(tmp_path_factory.mktemp("headless"), "headless", live=False))[0]


def same(path, headless):
    table = read_parquet(path)[0]
    return table.signals == headless.signals and table.values.tobytes() == headless.values.tobytes()


@pytest.mark.release("two viewers, 8 s; changes with Rerun")
def test_telemetry_is_the_same_whoever_watches(tmp_path, headless):
    stuck, killed = [], []

    def kill_one(address):
        for viewer in killed:
            viewer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            viewer.close()  # with a reset, as of a process that was killed
        killed[:] = [] if killed else [asking(address)]

    watchers = {
        "absent": lambda address: None,
        "takes nothing": lambda address: stuck.append(asking(address)),
        "killed": kill_one,
    }
    for name, watching in watchers.items():
        assert same(flown(tmp_path, name, watching=watching), headless), name
    for viewer in stuck:
        viewer.close()


def test_a_viewer_gets_the_envelope_of_every_tick_and_every_event(tmp_path, headless):
    (path := tmp_path / "seen.rrd").touch()
    with Session(scenarios.load("hold", CHANGES)) as session:
        files = Outputs(session, None, None, live=True)
        follow(session, session.scenario.ticks, files.sinks)
        viewer = urllib.request.urlopen(files._live.address.rstrip("/") + RECORDING)
        assert files.close() == []
        path.write_bytes(viewer.read())
    starts = np.arange(0, len(headless), 40)  # 25 bins a second of 1000 rows
    for name in ("q_rad", "torque_command_Nm", "sliding_s"):
        t_ns, drawn = telemetry_of(path, name, ENVELOPE)
        np.testing.assert_array_equal(t_ns // 1_000_000, [*starts, len(headless) - 1])
        low, _, high = np.split(drawn, 3, axis=1)
        for shown, bound in ((low, np.minimum), (high, np.maximum)):
            bounds = bound.reduceat(headless[name], starts).astype(np.float32)
            np.testing.assert_array_equal(shown, [*bounds, bounds[-1]])
    values, times = columns(path)
    events = [text for column in values[f"/{EVENTS}", "TextLog:text"] for (text,) in column.to_pylist()]
    assert events[-1] == "the run is complete"
    assert times[f"/{EVENTS}", "TextLog:text"][-1][-1] == round(1e9 * headless["t_s"][-1])
    assert not any(entity == f"/{TELEMETRY}" for entity, _ in values)  # a reader of files needs it


def test_plots_follow_the_cursor_over_the_chosen_window():
    common = common_signals(18)
    plots = Plots(View(60.0, 8.0, 18, (), live=True, window_s=4.0, decimated=True))
    axis = plots.above_zero("error", "°", plots.signal(common[1].name), least=0.1).properties["TimeAxis"]
    encoded = axis.view_range.as_arrow_array()
    assert encoded.to_pylist() == [{"start": -4_000_000_000, "end": 0}]
    for end in ("start", "end"):
        assert encoded.field(end).type_codes.to_pylist() == [1]  # relative to the cursor


@pytest.mark.release("1.2 s; test_viewer_server.py has a server of a killed process")
def test_a_killed_run_leaves_no_server():
    """Nothing that it started goes on: the kernel closes its ports, and no process has its mark."""
    mark = f"LIVE_MARK_{os.getpid()}"
    command = [sys.executable, "-m", "spheretwin", "simulate", "hold", "--live", "--duration", "60"]
    command += ["--plant.engine", "lagrangian"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, mark: "1"}
    )
    parts = urllib.parse.urlsplit(process.stderr.readline().split()[1])
    asking(parts.geturl()).close()
    process.send_signal(signal.SIGKILL)
    process.communicate()
    wait_for(lambda: not marked(mark))
    with socket.socket() as probe:
        assert probe.connect_ex((parts.hostname, parts.port)) != 0


def marked(mark):
    """Processes that have a variable in their environment."""
    results = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if mark.encode() in (process / "environ").read_bytes() and process.name != str(os.getpid()):
                results.append((process / "cmdline").read_bytes())
        except OSError:  # it has ended, or is another's
            continue
    return results


@pytest.mark.release("browser and viewer, 14 s; test_viewer_server.py has the addresses")
@needs_a_browser
def test_the_page_shows_the_run_and_asks_nothing_of_another_machine():
    """In a browser of which every request is seen, its workers' too."""
    with Session(scenarios.load("hold", CHANGES)) as session, Browser() as browser:
        files = Outputs(session, None, None, live=True)
        follow(session, session.scenario.ticks, files.sinks)
        page = browser.open(files._live.address)
        page.wait_for("window._handle !== undefined")
        wait_for(lambda: any(url.endswith(RECORDING) for url in page.requests))
        page.draw(5)  # half a second: what it asks for some time after it has started
        assert page.outside == []
        assert page.errors == []
        assert page.evaluate("window._handle.has_panicked()") is False
        assert files.close() == []
