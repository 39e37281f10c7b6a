"""Recordings read back: the telemetry bit for bit, of runs that raise, wait, or change their law; sizes."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.table import Table
from spheretwin.records.provenance import facts_of
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.viz.layout.view import EVENTS, SCENARIO, SUMMARY, TELEMETRY
from spheretwin.viz.recording import plots, stream
from spheretwin.viz.recording.currents import CoilCurrents
from spheretwin.viz.recording.plots import PlotData
from spheretwin.viz.recording.reader import read
from spheretwin.viz.recording.recorder import FEWEST_ROWS, Recorder
from spheretwin.viz.recording.stream import PENDING_CHUNKS
from tests.viz.recording.recordings import opened, recorded, session_and_facts, static, telemetry_of, timed
from tests.waiting import wait_for


def test_every_signal_is_recorded_bit_for_bit(tmp_path):
    session, recorder = opened(path := tmp_path / "run.rrd", "nutation", duration=2.3)
    table = session.advance(2300)
    with recorder:
        for first in range(0, 2300, 230):
            recorder.write(table.rows(first, first + 230))
    assert rr.strict_mode()  # without it Rerun turns a mistake into a warning and drops the data
    ticks_ns = np.arange(len(table)) * 1_000_000
    for signal in table.signals:
        times, values = telemetry_of(path, signal.name)
        np.testing.assert_array_equal(times, ticks_ns)
        assert values.tobytes() == np.ascontiguousarray(table[signal.name]).tobytes()


def test_signals_that_a_law_brings_on_the_way_change_no_component(tmp_path):
    """A viewer draws nothing of a component that changes its type; NaN stands for what a law does not log."""
    changes = [{"t_s": at, "set": "controller.law", "value": law} for at, law in ((0.1, "afsm"), (0.2, "pd"))]
    fields = {"controller.law": "pd", "duration": 0.3, "plant.engine": "lagrangian", "event": changes}
    with Session(scenarios.load("sinusoid", fields)) as session:
        facts, begun = facts_of(session.initial_scenario), session.signals
        with Recorder(session.actuator, begun, facts, path=tmp_path / "run.rrd") as recorder:
            follow(session, session.initial_scenario.ticks, [recorder])
    types = {}
    for chunk in RrdReader(tmp_path / "run.rrd").stream().filter(content=f"/{TELEMETRY}", is_static=False):
        for field in chunk.to_record_batch().schema:
            types.setdefault(field.name, set()).add(field.type)
    assert {"values_0", "values_1"} <= set(types)
    assert all(len(of_one) == 1 for of_one in types.values())
    table = read(tmp_path / "run.rrd").table
    assert "sliding_s" not in {signal.name for signal in begun}
    logged = np.isfinite(table["sliding_s"]).all(axis=1)
    np.testing.assert_array_equal(logged, np.arange(300) // 100 == 1)


@pytest.mark.parametrize("rate_Hz", [None, 60.0])
def test_a_recording_of_a_run_that_raises_has_its_last_rows(tmp_path, rate_Hz):
    chunks = []
    session, recorder = opened(path := tmp_path / "run.rrd", "nutation", rate_Hz, duration=0.2)

    def interrupted():
        with recorder:
            for _ in range(4):
                chunks.append(session.advance(50))
                recorder.write(chunks[-1])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    q_rad = np.concatenate([rows["q_rad"] for rows in chunks])
    times, recorded_q_rad = telemetry_of(path, "q_rad")
    assert times[-1] == 199_000_000
    np.testing.assert_array_equal(recorded_q_rad[-1], q_rad[-1])
    np.testing.assert_array_equal(recorded_q_rad.max(axis=0), q_rad.max(axis=0))
    assert len(times) < 100 if rate_Hz else len(times) == 200


def busy(recorder):
    """Occupy the recorder's thread until the event that is returned."""
    done = threading.Event()
    recorder._submit(done.wait)
    return done


def test_run_waits_for_a_recorder_that_is_behind(tmp_path):
    session, recorder = opened(tmp_path / "run.rrd")
    rows = Table(session.signals, np.zeros((FEWEST_ROWS, width(session.signals))))
    with recorder:
        done, written = busy(recorder), []

        def write_all():
            for _ in range(3 * PENDING_CHUNKS):
                recorder.write(rows)
                written.append(1)

        writer = threading.Thread(target=write_all)
        writer.start()
        try:
            # Room for the work at hand, and for one before it.
            wait_for(lambda: len(written) >= PENDING_CHUNKS - 2, while_alive=writer)
            time.sleep(0.05)  # time enough for hundreds more, were there no bound
            assert len(written) < PENDING_CHUNKS
        finally:
            done.set()
            writer.join()
    assert len(telemetry_of(tmp_path / "run.rrd", "q_rad")[0]) == FEWEST_ROWS * len(written)


def test_every_recording_is_an_application_of_its_own(tmp_path):
    """A viewer keeps one layout for each application, and figures of the run stand in the layout."""
    for name in "ab":
        recorded(tmp_path / f"{name}.rrd", duration=0.02)
    ids = {RrdReader(path).recordings()[0].application_id for path in tmp_path.iterdir()}
    assert len(ids) == 2
    assert set("".join(ids)) <= set("abcdefghijklmnopqrstuvwxyz0123456789-")


def test_texts_have_escapes_for_characters_that_the_viewer_cannot_draw(tmp_path):
    session, facts = session_and_facts()
    facts = replace(facts, name="漢 α Ж ß", description="😀 ±1 N·m – ok")
    with Recorder(session.actuator, session.signals, facts, path=(path := tmp_path / "run.rrd")) as recorder:
        recorder.write(session.advance(10))
        recorder.note(0.005, "law 漢.py:Ä")
        recorder.finish(session.status)
    name = "\\u6f22 α Ж ß"
    (headline,) = static(path, SUMMARY, "TextDocument:text")
    assert f"{name} under afsm" in headline
    (text,) = static(path, SCENARIO, "TextDocument:text")
    assert text.startswith(f"# {name}\n\n\\U0001f600 ±1 N·m – ok\n")
    assert "law \\u6f22.py:Ä" in [text for _, (text,) in timed(path, EVENTS, "TextLog:text")]
    assert read(path).facts["name"] == "漢 α Ж ß"  # for readers of the data


def size_and_raw(path, duration_s, rate_Hz):
    """Bytes of a recording, and of the numbers of all of its run's rows."""
    session, recorder = opened(path, "sinusoid", rate_Hz, duration=duration_s)
    ticks = session.initial_scenario.ticks
    with session, recorder:
        follow(session, ticks, [recorder])
    return np.array([path.stat().st_size, ticks * width(session.signals) * np.float64().itemsize])


# Shares of the raw numbers: 760 bytes a row that do not compress. Every row has 13 derived quantities
# in single precision, 18 bars in half precision and 18 colours: 142 bytes, and some 40 of times and places.
# Of 1000 rows a second, 60 and those that stand out are a tenth. Telemetry, poses, traces, map and states fit
# into what the compression of the numbers saves.
@pytest.mark.parametrize(
    ("rate_Hz", "share", "absent"), [(None, 1.2, ()), (60.0, 0.15, ()), (None, 1.0, (CoilCurrents, PlotData))]
)
def test_pictures_take_a_bounded_share_of_the_numbers(tmp_path, monkeypatch, rate_Hz, share, absent):
    monkeypatch.setattr(plots, "OPENED_AFTER_s", np.inf)  # a slow machine would add a layout
    monkeypatch.setattr(stream, "PARTS", [part for part in stream.PARTS if part not in absent])
    brief, long = (size_and_raw(tmp_path / f"{each:g}.rrd", each, rate_Hz) for each in (10.0, 20.0))
    grown, raw = long - brief
    assert grown <= share * raw
