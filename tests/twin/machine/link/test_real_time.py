"""Real time: no work of a loop is done for the first time in it, and permissions of the system."""

import contextlib
import gc
import json
import os
import subprocess
import sys

import pytest

from spheretwin.cli import doctor
from spheretwin.machine.link import real_time as permissions
from spheretwin.machine.link.real_time import Granted, real_time
from spheretwin.machine.link.rehearsal import FileThread
from tests.twin.machine.link import first_time_work
from tests.waiting import UNLIMITED_S

SIDES = ("machine", "drive")


@contextlib.contextmanager
def side(verb, folder, *words):
    files = ["--telemetry", folder / f"{verb}.parquet", "--record", folder / f"{verb}.rrd", "--json"]
    command = [sys.executable, "-m", first_time_work.__name__, verb, "sinusoid", *words, *files]
    with subprocess.Popen(
        [*map(str, command), "--timeout-ms", str(1000 * UNLIMITED_S)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        yield process


@pytest.mark.release("60 s at the pace of the clock")
def test_neither_side_does_first_time_work_in_its_loop(tmp_path):
    """60 chunks of the length that once stalled both sides at its end; an event changes the loop."""
    event = ["--event.0.t-s", "2.5", "--event.0.set", "controller.law", "--event.0.value", "pd"]
    own = ["--listen", "udp://:0", "--real-time", "--idle-s", UNLIMITED_S, "--duration", "70"]
    with side("machine", tmp_path, *own, "--hardware", "prototype") as twin:
        address = f"udp://:{twin.stderr.readline().strip().rpartition(':')[2]}"
        ours = ["--machine", address, "--arm", "--duration", "60", "--estimator.kind", "kalman", *event]
        # A rotor moves on while one of the two waits for a processor.
        limits = ["--limit-rate-rad-s", "1000", "--limit-chi2", "1e9", "--log", tmp_path / "log.parquet"]
        shadow = ["--shadow", tmp_path / "shadow.parquet"]
        with side("drive", tmp_path, *ours, *limits, *shadow) as controller:
            results = {"drive": controller.communicate()}
        results["machine"] = twin.communicate()
    for verb, (out, err) in results.items():
        result, counts = json.loads(out), json.loads(err.splitlines()[-1])
        assert result["status"] == {"drive": "completed", "machine": "interrupted"}[verb], err
        assert result["simulated_s"] > 50.0
        assert counts == {"imports": [], "compilations": 0, "collections": 0}, verb


def test_a_block_in_real_time_leaves_the_process_as_it_was():
    switch_s, scheduler = sys.getswitchinterval(), os.sched_getscheduler(0) if sys.platform == "linux" else 0
    with real_time() as granted:
        assert not gc.isenabled()
        assert sys.getswitchinterval() == pytest.approx(permissions.SWITCH_s)
        if granted.priority:
            assert os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
    assert gc.isenabled()
    assert sys.getswitchinterval() == pytest.approx(switch_s)
    assert (os.sched_getscheduler(0) if sys.platform == "linux" else 0) == scheduler


@pytest.mark.skipif(
    sys.platform != "linux", reason="memory is locked, and its limit is read in /proc, on Linux alone"
)
def test_a_limited_amount_of_memory_is_not_locked(monkeypatch, tmp_path):
    import resource

    status = tmp_path / "status"
    monkeypatch.setattr(permissions, "STATUS", status)
    monkeypatch.setattr(resource, "getrlimit", lambda which: (65536, 65536))
    for bits, permitted in (("0000000000000000", False), ("0000000000004000", True)):
        status.write_text(f"Name:\tpython\nCapEff:\t{bits}\n")
        assert permissions._may_lock_all() == permitted
    monkeypatch.setattr(resource, "getrlimit", lambda which: (resource.RLIM_INFINITY,) * 2)
    status.unlink()
    assert permissions._may_lock_all()


@pytest.mark.parametrize("granted", [Granted(True, True), Granted(False, False)])
def test_the_doctor_reports_what_is_permitted(granted, monkeypatch):
    monkeypatch.setattr(doctor, "real_time", lambda: contextlib.nullcontext(granted))
    locked, priority = doctor.real_time_permissions()
    assert (locked.ok, priority.ok) == granted
    assert bool(locked.advice) == bool(priority.advice) == (not granted.priority)


def test_files_receive_all_rows_in_order_before_the_end():
    class Sink:
        def __init__(self):
            self.calls = []

        def __getattr__(self, name):
            return lambda *values: self.calls.append((name, *values))

    sinks = Sink(), Sink()
    thread = FileThread(sinks)
    for number in range(100):
        thread.write(number)
    thread.note(1.0, "text")
    thread.finish("completed")
    expected = [*(("write", number) for number in range(100)), ("note", 1.0, "text"), ("finish", "completed")]
    assert [sink.calls for sink in sinks] == [expected] * 2
