"""Reports of `simulate` and `review`: faults, hardware, use of tolerances, time of compilation."""

import json

import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.runtime import Runtime
from spheretwin.scenario.reading import shipped
from spheretwin.session import Session

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
