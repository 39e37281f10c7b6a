"""Reports of `simulate` and `review`: faults, hardware, use of tolerances, time of compilation."""

import json
import re
from pathlib import Path

import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.analysis.tolerances import Exceeded
from spheretwin.cli import review, simulate
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.runtime import Runtime
from spheretwin.scenario.reading import shipped
from spheretwin.session import Session
from spheretwin.viz.terminal.reviews import SignalTolerance

PLANT = ["--plant.engine", "lagrangian"]


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def fault(place, target, mode, start_s, **fields):
    values = {"target": target, "mode": mode, "start-s": start_s, **fields}
    return [text for name, value in values.items() for text in (f"--fault.{place}.{name}", str(value))]


def printed(capsys, *arguments, code=cli.DONE):
    assert cli.main([str(argument) for argument in arguments]) == code
    return capsys.readouterr()


def test_simulate_states_each_fault_with_its_detection(capsys):
    faults = [
        *fault(0, "coil.07", "open", 0.1, detection="true"),
        *fault(1, "coil.03", "short", 0.15, **{"reported-to-controller": "true"}),
        *fault(2, "encoder.gamma", "stuck", 0.2, **{"end-s": 0.201}),
    ]
    out, _ = printed(capsys, "simulate", "nutation", "--duration", "0.3", *PLANT, *faults)
    lines = [line for line in out.splitlines() if line.startswith("fault ")]
    # The detector needs five ticks of one millisecond.
    assert lines == [
        "fault coil.07 open from 0.1 s, detected after 5 ms",
        "fault coil.03 short from 0.15 s, reported to the controller",
        "fault encoder.gamma stuck from 0.2 s to 0.201 s, not detected",
    ]


def test_a_fault_after_the_end_of_a_failed_run_is_not_started(capsys):
    flags = ["--controller.law", "pd", "--disturbance.load", "5", *fault(0, "coil.07", "open", 2.0)]
    out, err = printed(capsys, "simulate", "sinusoid", *PLANT, *flags, code=cli.FAILED)
    assert "fault coil.07 open from 2.000 s: not started, the run ended before" in out
    assert "α reached the end of its range, -80° to 80°" in " ".join(out.split())
    assert "left_workspace, α reached the end of its range" in err


@pytest.mark.parametrize("hardware", ["ideal", "electronics"])
def test_the_title_names_the_hardware_and_no_description_contradicts_it(capsys, hardware):
    out, _ = printed(capsys, "simulate", "tilt", "--duration", "0.01", *PLANT, "--hardware", hardware)
    assert out.startswith(f"tilt under afsm, {hardware} hardware: completed")
    for name in shipped():
        description = scenarios.load(name, {"hardware": hardware}).description
        assert not any(word in description for word in ("ideal", "electronics", "sensor", "bearing"))


def test_a_gate_states_shares_and_the_largest_excess(capsys, tmp_path):
    for name, load in (("a", 1.0), ("b", 1.0), ("c", 1.5)):
        flags = ["--duration", "0.3", "--disturbance.load", load, "--telemetry", tmp_path / f"{name}.parquet"]
        printed(capsys, "simulate", "sinusoid", *PLANT, *flags)
    a, b, c = (str(tmp_path / f"{name}.parquet") for name in "abc")
    out, err = printed(capsys, "review", a, b, "--tolerance", "gate")
    assert "b.parquet against a.parquet: 3 of 3 signals within their tolerances" in out
    assert err == ""
    out, err = printed(capsys, "review", a, c, "--tolerance", "gate", code=cli.FAILED)
    result = json.loads(printed(capsys, "review", a, c, "--tolerance", "gate", "--json", code=cli.FAILED)[0])
    assert result["differing_fields"] == {"L": ["1", "1.5"]}
    (signals,) = result["tolerances"]
    first = result["exceeded"][0]
    largest = next(signal for signal in signals if signal["signal"] == first["signal"])
    assert largest["excess"] >= first["by"]
    assert f"{first['signal']} {first['axis']} leaves its tolerance first at {first['t_s']:.6g} s" in err
    assert (
        f"by {first['by']:.3g}; its largest excess is {largest['excess']:.3g} at {largest['t_s']:.6g} s"
        in err
    )
    assert {error["field"] for errors in result["nominal_errors"] for error in errors} == {
        "nominal.inertia_kg_m2"
    }


def test_the_time_of_a_run_does_not_contain_that_of_its_compilation(monkeypatch):
    """The measured calls receive machine code."""
    entries = []
    run = Runtime.run

    def run_with_check(runtime, inputs, log):
        entries.append(vars(runtime)["loop"])
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
def test_the_outputs_of_a_run_are_those_of_its_options(capsys, tmp_path, monkeypatch, options, expected):
    def refuse(session, *settings):
        assert settings == expected
        raise InputError("outputs: expected others")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(simulate, "Outputs", refuse)
    _, err = printed(capsys, "simulate", "hold", *PLANT, *options.split(), code=cli.BAD_INPUT)
    assert err == "spheretwin: outputs: expected others\n"
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_completed_fails_the_run_and_keeps_its_figures(capsys, monkeypatch):
    monkeypatch.setattr(simulate.Outputs, "close", lambda files: [SpheretwinError("a.rrd: the disk is full")])
    out, err = printed(capsys, "simulate", "hold", *PLANT, "--duration", 0.01, code=cli.FAILED)
    assert out.startswith("hold under afsm, ideal hardware: completed")
    assert err == "spheretwin: a.rrd: the disk is full\n"


def test_the_end_of_a_failed_run_has_time_reason_and_pose(capsys):
    """The line is that of the figures; the same run with and without JSON."""
    stuck = fault(0, "encoder.gamma", "dropout", 0.01)
    flags = [*PLANT, "--hardware", "electronics", "--duration", 0.5, "--watchdog.on", "true", *stuck]
    out, err = printed(capsys, "simulate", "nutation", *flags, "--json", code=cli.FAILED)
    run = json.loads(out)
    assert run["status"] == "failsafe"
    assert 0.01 < run["simulated_s"] < 0.5
    pose = r"\(α -?\d+\.\d°, β -?\d+\.\d°, γ -?\d+\.\d°\)"
    line = (
        f"spheretwin: the run ended at {run['simulated_s']:.3f} s of 0.5 s: failsafe, no fresh measurement "
    )
    assert re.fullmatch(re.escape(line) + pose, err.removesuffix("\n"))
    out, again = printed(capsys, "simulate", "nutation", *flags, code=cli.FAILED)
    assert again == err
    assert f"failsafe at {run['simulated_s']:.3f} s of 0.5 s, no fresh measurement" in " ".join(out.split())


def test_output_of_a_law_is_not_among_the_json(capsys, tmp_path):
    (tmp_path / "law.py").write_text(
        "def loud(t, reference, measurement, parameters, state, torque):\n"
        "    print('here')\n    torque[:] = 0\n"
    )
    flags = [*PLANT, "--controller.law", f"{tmp_path / 'law.py'}:loud", "--duration", 0.001]
    out, err = printed(capsys, "simulate", "hold", *flags, "--json")
    assert json.loads(out)["status"] == "completed"
    assert "here" in err
    out, err = printed(capsys, "simulate", "hold", *flags)
    assert "here" in out
    assert err == ""


def test_a_run_without_a_tick_has_no_time_and_no_pose(capsys, tmp_path):
    (tmp_path / "law.py").write_text(
        "def broken(t, reference, measurement, parameters, state, torque):\n    torque[:] = float('nan')\n"
    )
    flags = [*PLANT, "--controller.law", f"{tmp_path / 'law.py'}:broken", "--duration", 0.01]
    _, err = printed(capsys, "simulate", "hold", *flags, code=cli.FAILED)
    assert err == "spheretwin: the run ended before its first tick was complete: diverged\n"


@pytest.mark.parametrize(
    ("count", "more"), [(1, ""), (2, "; 1 more signal later"), (3, "; 2 more signals later")]
)
def test_the_first_violation_is_stated_with_the_largest_excess_of_its_signal(count, more):
    places = [
        Exceeded("b.parquet", name, axis, 0.5, 0.125)
        for name, axis in (("q_rad", "β"), ("t_s", ""), ("error_rad", "γ"))
    ]
    signals = [
        SignalTolerance("error_rad", 4.0, "γ", 0.75, 0.25),
        SignalTolerance("q_rad", 2.0, "α", 0.625, 0.375),
        SignalTolerance("t_s", 2.0, "", 0.875, 0.4375),
    ]
    assert review._first(places[:count], signals) == (
        "b.parquet: q_rad β leaves its tolerance first at 0.5 s, by 0.125;"
        f" its largest excess is 0.375 at 0.625 s{more}"
    )
    assert review._first(places[1:2], signals).startswith(
        "b.parquet: t_s leaves its tolerance first at 0.5 s"
    )
