"""The watchdog in a run: each reason by what provokes it, the rundown, and how it ends; else, nothing."""

import json

import numba
import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.control.supervision.watchdog import Reason
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.scenario.reading import shipped
from spheretwin.session import Session
from spheretwin.simulation import follow, simulate

RUNDOWN = 30
WATCHED = {"plant.engine": "mujoco", "watchdog.on": True, "watchdog.rundown_s": RUNDOWN * 1e-3, "seed": 4}


def scenario(name="nutation", hardware="electronics", **changes):
    return scenarios.load(name, {"hardware": hardware, **WATCHED, **changes})


def fault(target, mode, value=None, start_s=0.1, **more):
    return {"target": target, "mode": mode, "start_s": start_s, **({"value": value} if value else {}), **more}


# A fault that never comes: the loop is then that of the electronics.
IDEAL = {"hardware": "ideal", "fault": [fault("coil.03", "open", start_s=900.0)]}
# What provokes each reason, and the tick at which it must trip, where that is exact.
PROVOKED = {
    "adc is silent": (Reason.STALE, {"fault": [fault("adc", "dropout")]}, 104),
    "encoder is silent": (Reason.STALE, {"fault": [fault("encoder.gamma", "dropout")]}, 104),
    "ticks are three": (
        Reason.STALE, {"fault": [fault("adc", "dropout")], "watchdog.stale_ticks": 3}, 102,
    ),
    "track slips": (Reason.JUMP, {"fault": [fault("pot.alpha", "offset", 0.2)]}, 100),
    "wiper lifts": (Reason.JUMP, {"fault": [fault("pot.beta", "open", 2.0)]}, 100),
    "counts are lost": (Reason.JUMP, {"fault": [fault("encoder.gamma", "offset", 0.5)]}, 100),
    "coil is hot": (Reason.TEMPERATURE, {"drive.shutdown_degC": 20.3}, None),
    "rotor is fast": (Reason.SPEED, {"watchdog.largest_rate_rad_s": 3.0, **IDEAL}, None),
    "starts too fast": (Reason.SPEED, {"plant.initial_rad_s": (0.0, 0.0, 90.0), **IDEAL}, 0),
    "edge is near": (Reason.EDGE, {"watchdog.edge_margin_rad": 1.3}, None),
}  # fmt: skip


def failed_safely(run, reason, at=None):
    """Hold a run to what every one owes that a watchdog ended; returns the tick at which it tripped."""
    table = run.telemetry
    reasons = table["failsafe_reason"]
    tripped = int(np.flatnonzero(reasons)[0])
    assert run.status == "failsafe"
    assert set(reasons[tripped:].tolist()) == {float(reason)}
    assert at is None or tripped == at
    assert np.isfinite(table.values).all()
    command = table["current_command_A"]
    after = tripped + (reason == Reason.TEMPERATURE)  # which is known at the end of a period
    assert not command[after:].any()
    assert not table["torque_command_Nm"][after:].any()
    return tripped


@pytest.mark.parametrize(("action", "ticks"), [("release", RUNDOWN + 0.4), ("short", RUNDOWN - 0.4)])
@pytest.mark.parametrize("how", list(PROVOKED))
def test_each_reason_by_what_provokes_it(how, action, ticks):
    reason, changes, at = PROVOKED[how]
    run = simulate(scenario(**changes, **{"watchdog.action": action, "watchdog.rundown_s": ticks * 1e-3}))
    tripped = failed_safely(run, reason, at)
    assert len(run.telemetry) == tripped + 1 + RUNDOWN
    assert Reason.NONE not in run.telemetry["failsafe_reason"][tripped:]
    currents = run.telemetry["current_A"][tripped + 8 :]
    if action == "release":
        # Ten time constants later, at least, the amplifiers' offsets are what is left.
        assert np.abs(currents).max() <= 0.8e-3 * (1 + 1e-9)
    else:
        assert np.abs(currents).max() > 2e-3


BAD = (np.nan, np.inf, -np.inf, 1e300)


@numba.njit
def no_number(t, reference, measurement, parameters, state, torque):
    for axis in range(3):
        torque[axis] = (
            BAD[int(parameters[0])] if t >= 0.05 else -0.5 * (measurement[0, axis] - reference[0, axis])
        )


@pytest.mark.parametrize("bad", range(len(BAD)))
def test_a_law_that_gives_no_number(bad):
    law = Law("lost", no_number, np.array([float(bad)]), np.zeros(0))
    run = simulate(scenario("hold"), law=law)
    assert failed_safely(run, Reason.COMMAND, 50) == 50
    assert len(run.telemetry) == 51 + RUNDOWN
    plain = simulate(scenario("hold", **{"watchdog.on": False}), law=law)
    assert plain.status == "diverged"
    assert len(plain.telemetry) == 50


OWN_LOOP = pytest.mark.release("compiles a loop of its own for 10 s; the other value has the same")


@pytest.mark.parametrize("hardware", ["electronics", pytest.param("ideal", marks=OWN_LOOP)])
@pytest.mark.parametrize("action", ["release", "short"])
def test_a_fault_that_never_comes_moves_no_bit_of_what_a_watchdog_does(hardware, action):
    early = {"watchdog.edge_margin_rad": 1.25, "watchdog.action": action}
    plain = simulate(scenario(hardware=hardware, **early)).telemetry
    planned = simulate(scenario(**IDEAL | {"hardware": hardware}, **early)).telemetry
    assert plain["failsafe_reason"][-1] == Reason.EDGE
    for signal in plain.signals:
        assert planned[signal.name].tobytes() == plain[signal.name].tobytes()


def test_a_hanging_controller_cannot_keep_the_currents_from_being_taken():
    faults = [fault("controller", "stuck"), fault("encoder.gamma", "dropout", start_s=0.12)]
    run = simulate(
        scenario(fault=faults, **{"watchdog.largest_rate_rad_s": 1e3, "watchdog.edge_margin_rad": -5.0})
    )
    tripped = int(np.flatnonzero(run.telemetry["failsafe_reason"])[0])
    assert np.abs(run.telemetry["current_A"][tripped + 8 :]).max() <= 0.8e-3 * (1 + 1e-9)


def test_what_a_watchdog_has_done_is_no_find_of_the_detector():
    changes = {"detector.detect": True, "watchdog.action": "short", "watchdog.edge_margin_rad": 1.2}
    run = simulate(scenario(**changes))
    assert run.status == "failsafe"
    assert not run.telemetry["group_out"].any()


@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("engine", ["mujoco", pytest.param("lagrangian", marks=OWN_LOOP)])
def test_it_never_trips_in_a_shipped_scenario_of_the_prototype(name, engine):
    fields = {"hardware": "electronics", "plant.engine": engine}
    run = simulate(name, fields)
    assert run.scenario.watchdog.on
    assert run.status == "completed"
    assert not run.telemetry["failsafe_reason"].any()
    off = simulate(name, {**fields, "watchdog.on": False})
    for signal in off.telemetry.signals:
        assert run.telemetry[signal.name].tobytes() == off.telemetry[signal.name].tobytes()


def test_one_that_is_switched_on_again_begins_anew():
    with Session(scenario("sinusoid")) as session:
        session.advance(100)
        session.set("watchdog.on", False)
        session.advance(900)
        session.set("watchdog.on", True)
        assert not session.advance(500)["failsafe_reason"].any()


def test_power_at_shorted_ends_is_none(actuator):
    """What turns in the coils while they brake comes from the rotor."""
    run = simulate(scenario(fault=[fault("pot.alpha", "offset", 0.2)], **{"watchdog.action": "short"}))
    table = run.telemetry
    assert not table["coil_power_W"][101:].any()
    assert np.all(table["supply_power_W"][105:] <= 24 * 18 * 0.8e-3 * (1 + 1e-9))
    rates = [rate_jacobian(q) @ v for q, v in zip(table["q_rad"], table["qdot_rad_s"], strict=True)]
    braking = np.sum(table["torque_Nm"] * rates, axis=1)[110:]
    assert np.mean(braking < 0) > 0.9


LATE = {"duration": 0.13, "fault": [fault("pot.alpha", "offset", 0.2)]}  # it trips at tick 100


def test_a_trip_within_the_rundown_before_the_end_is_no_completed_run():
    with Session(scenario(**LATE)) as session, Session(scenario(**LATE)) as other:
        session.advance(100)
        assert (session.status, session.ended) == ("running", False)
        session.advance(10)
        assert (session.status, session.ended) == ("failsafe", False)
        snapshot = session.snapshot()
        rest = session.advance(500)
        assert len(rest) == 1 + RUNDOWN - 10  # a session has no planned end
        assert (session.status, session.ended) == ("failsafe", True)
        assert len(session.advance(10)) == 0
        other.restore(snapshot)
        stop = iter([True])
        assert follow(other, 130, [], live=True, stop_requested=lambda: next(stop)) == "failsafe"
        assert other.advance(500).values.tobytes() == rest.values.tobytes()
        assert other.reason == Reason.JUMP
    run = simulate(scenario(**LATE))
    assert (run.status, len(run.telemetry)) == ("failsafe", 130)
    for ticks, status in ((100, "completed"), (101, "failsafe")):
        assert simulate(scenario(**{**LATE, "duration": ticks * 1e-3})).status == status


def test_a_study_tells_of_its_failsafe_rows_and_exits_1(tmp_path, capsys):
    source = tmp_path / "late.toml"
    source.write_text(
        'name = "late"\nscenario = "nutation"\n'
        '[fields]\nhardware = "electronics"\n"plant.engine" = "mujoco"\n'
        'fault = [{target = "pot.alpha", mode = "offset", start_s = 0.1, value = 0.2}]\n'
        '[[axis]]\nfield = "duration"\nkind = "values"\nvalues = [0.05, 0.13]\n'
    )
    assert cli.main(["sweep", str(source), "--out", str(tmp_path / "out"), "--json"]) == 1
    printed = capsys.readouterr()
    report = json.loads(printed.out)
    assert (report["rows"], report["failed"]) == (2, 1)
    assert report["summary"]["afsm"]["statuses"] == {"completed": 1, "failsafe": 1}
    assert printed.err.endswith(f": failsafe, {Reason.JUMP.text}\n")
