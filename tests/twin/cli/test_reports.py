"""Reports of `simulate` and `review`: faults, hardware, use of tolerances, time of compilation."""

import inspect
import re
from pathlib import Path

import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.cli import simulate
from spheretwin.loop.runtime import Runtime
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.scenario.reading import shipped
from spheretwin.session import Session
from tests.twin.cli.calls import call, refusal, succeeded, under_law

PLANT = ["--plant.engine", "lagrangian"]


def test_simulate_states_the_time_of_detection_of_a_fault():
    fault = {"target": "coil.07", "mode": "open", "start-s": 0.1, "detection": "true"}
    flags = [text for name, value in fault.items() for text in (f"--fault.0.{name}", value)]
    out = succeeded("simulate", "nutation", "--duration", "0.3", *PLANT, *flags)
    # The detector needs five ticks of one millisecond.
    assert "\nfault coil.07 open from 0.1 s, detected after 5 ms\n" in out


@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("hardware", ["ideal", "electronics"])
def test_no_description_contradicts_the_hardware(name, hardware):
    description = scenarios.load(name, {"hardware": hardware}).description
    assert not re.search("ideal|electronics|sensor|bearing", description)


def test_the_time_of_a_run_does_not_contain_that_of_its_compilation(monkeypatch):
    """The measured calls receive machine code."""
    entries = []
    run = Runtime.run

    def run_with_check(runtime, inputs, log):
        entries.append(inspect.getclosurevars(vars(runtime)["loop"]).nonlocals["entry"])
        return run(runtime, inputs, log)

    monkeypatch.setattr(Runtime, "run", run_with_check)
    with Session(scenarios.load("hold", {"plant.engine": "lagrangian"})) as session:
        assert "loop" not in vars(session._runtime)
        session.advance(3)
    (compiled,) = entries
    assert not hasattr(compiled, "overloads")  # a dispatcher would compile at its first call


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ("", (None, None, False, "overview", None, 0, 10.0)),
        (
            "--record a.rrd --telemetry b.parquet --record-rate 50 --view control",
            (Path("a.rrd"), Path("b.parquet"), False, "control", 50.0, 0, 10.0),
        ),
        ("--live --live-window 3 --view control", (None, None, True, "control", None, 0, 3.0)),
    ],
    ids=["none", "files", "live"],
)
def test_the_outputs_of_a_run_are_those_of_its_options(tmp_path, monkeypatch, options, expected):
    def refuse(session, *settings, replay_of):
        assert (settings, replay_of) == (expected, "")
        raise InputError("outputs: expected others")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(simulate, "Outputs", refuse)
    assert refusal("simulate", "hold", *PLANT, *options.split()) == "outputs: expected others"
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_completed_fails_the_run_and_keeps_its_figures(monkeypatch):
    monkeypatch.setattr(simulate.Outputs, "close", lambda files: [SpheretwinError("a.rrd: the disk is full")])
    result = call("simulate", "hold", *PLANT, "--duration", 0.01)
    assert (result.code, result.err) == (cli.FAILED, "spheretwin: a.rrd: the disk is full\n")
    assert result.out.startswith("hold under afsm, ideal hardware: completed")


def test_output_of_a_law_is_not_among_the_json(tmp_path):
    flags = [*under_law(tmp_path, "print('here')"), "--duration", 0.001]
    result = call(*flags, "--json")
    assert result.json["status"] == "completed"
    assert "here" in result.err
    assert "here" in succeeded(*flags)


def test_a_run_without_a_tick_has_no_time_and_no_pose(tmp_path):
    result = call(*under_law(tmp_path, "torque[:] = float('inf')"), "--duration", 0.01)
    message = "spheretwin: the run ended before its first tick was complete: diverged\n"
    assert (result.code, result.err) == (cli.FAILED, message)
