"""Files and code of the user: outside the threads that serve pages and the loop, and with a time limit."""

import os
import sys
import threading
from types import SimpleNamespace

import pytest

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench, preparation
from spheretwin.bench.folder import Folder
from spheretwin.bench.preparation import Preparation
from spheretwin.cli.bench import read, settings_of
from spheretwin.models.base.errors import InputError
from tests.twin.bench.cases import FREE, done, said
from tests.waiting import wait_for

LAW = """
import sys
import threading
from spheretwin.control.law import Law
from spheretwin.control.law_components.parameters import LawParameters

RUN_IN = vars(sys).setdefault("names_of_threads", [])  # common to all modules of this file
RUN_IN.append(threading.current_thread().name)

class Mine(LawParameters):
    gain: float = 1.0

    def build(self, known):
        RUN_IN.append(threading.current_thread().name)
        def step(t, reference, measurement, parameters, state, torque):
            torque[0] = torque[1] = torque[2] = 0.0 * parameters[0]
        return Law("mine", step, [self.gain], [])
"""


def test_code_of_the_user_runs_only_in_threads_of_preparations(tmp_path):
    (file := tmp_path / "law.py").write_text(LAW)
    scenario = scenarios.load("sinusoid", FREE)
    with Bench(scenario, folder=Folder(tmp_path, scenario)) as bench:
        bench.begin()
        for name, arguments in (
            ("set", {"name": "controller.law", "value": read("controller.law", "law.py:Mine")}),
            ("set", {"name": "controller.gain", "value": 2.0}),
            ("start", {}),
            ("set", {"name": "controller.gain", "value": 3.0}),
            ("off", {}),
            ("hold", {}),
            ("reset", {}),
        ):
            ticket = bench.command(name, **arguments)
            assert ticket.wait(None) == "done", ticket.refused
        assert settings_of(bench.fields())  # what the page reads
        assert bench.state().law == f"{file}:Mine"
    names = vars(sys).pop("names_of_threads")
    assert len(names) >= 4
    assert set(names) <= {"prepare set", "prepare reset"}


def test_a_file_that_has_changed_meanwhile_is_not_read_in_the_loop(made, tmp_path, monkeypatch):
    """The preparation has read it; a pipe in its place would block the loop for ever."""
    (file := tmp_path / "law.py").write_text(LAW)
    ticket = made.command("set", name="controller.law", value=f"{file}:Mine")
    with monkeypatch.context() as patch:
        patch.setattr(Preparation, "done", False)  # however fast it is, the loop has not used it yet
        made._processor.process(waits=False)
    made._processor._preparing[1]._thread.join()
    file.unlink()
    made.advance(1)
    assert ticket.refused is None
    assert made.state().law == f"{file}:Mine"


class BlockingWork:
    """Work that waits until it is let go, and returns something that is closed."""

    def __init__(self):
        self.go, self.closed = threading.Event(), threading.Event()

    def __call__(self):
        self.go.wait()
        return self

    def close(self):
        self.closed.set()


def test_a_preparation_that_is_too_late_is_refused_and_its_result_closed():
    work = BlockingWork()
    prepared = Preparation("load", work, limit_s=0.05)
    with pytest.raises(InputError, match=r"expected load to be prepared within 0\.05 s, received nothing"):
        prepared.result()
    assert prepared.done
    assert not work.closed.is_set()
    work.go.set()
    prepared._thread.join()
    assert work.closed.is_set()


def test_a_preparation_in_time_gives_its_result_or_its_error():
    work = BlockingWork()
    work.go.set()
    assert Preparation("load", work).result() is work
    assert not work.closed.is_set()
    with pytest.raises(ZeroDivisionError):
        Preparation("load", lambda: 1 / 0).result()
    with pytest.raises(InputError, match="expected load to be prepared, received SystemExit"):
        Preparation("load", exit).result()


def test_stop_does_not_wait_for_a_law_that_never_loads(made, tmp_path, monkeypatch):
    ours, theirs = os.pipe()
    (tmp_path / "law.py").write_text(f"import os\nos.read({ours}, 1)\n")  # it loads when the pipe is closed
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(preparation, "time", SimpleNamespace(monotonic=lambda: clock.now))
    monkeypatch.setattr(preparation, "LIMIT_s", 0.5)
    made.begin()
    late = made.command("set", name="controller.law", value=f"{tmp_path / 'law.py'}:Mine")
    _, preparing = wait_for(lambda: made._processor._preparing)
    assert made.command("stop").wait(None) == "done"
    assert not late.done
    assert made.state().stopped
    clock.now = 0.5
    assert late.wait(None) == "refused"
    assert "within 0.5 s" in late.refused
    assert made.command("reset").wait(None) == "done"  # others follow it
    os.close(theirs)
    preparing._thread.join()
    os.close(ours)


def test_a_pipe_is_refused_at_once(made, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    pipe = str(tmp_path / "pipe")
    for name, arguments in (
        ("replay", {"file": pipe}),
        ("set", {"name": "plant.mjcf", "value": pipe}),
        ("set", {"name": "plant.torque_curve", "value": pipe}),
        ("trajectory", {"fields": {"shape": "waypoints", "file": pipe}}),
        ("set", {"name": "trajectory", "value": {"shape": "waypoints", "file": pipe}}),
        ("load", {"source": "hold", "overrides": {"plant.mjcf": pipe}}),
        ("record", {"telemetry": pipe}),
        ("save", {"file": pipe}),
    ):
        assert "expected a regular file" in said(made, name, **arguments), name
    os.rename(pipe, tmp_path / "pipe.py")
    os.mkfifo(tmp_path / "pipe.toml")
    assert "regular" in said(made, "set", name="controller.law", value=f"{pipe}.py:Mine")
    assert "regular" in said(made, "load", source=f"{pipe}.toml")
    done(made, "start")
