"""The detector in a run: every open and every shorted group found and named, and no healthy one ever."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.supervision.enabled_groups import DETECTED_OPEN, DETECTED_SHORTED, REPORTED
from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.status import Events
from spheretwin.models.telemetry.table import Table
from spheretwin.session import Session
from spheretwin.simulation import simulate

GROUPS = 18
START_S = 1.0


def scenario(name="nutation", hardware="electronics", **changes):
    detecting = {"hardware": hardware, "plant.engine": "mujoco", "detector.detect": True, "seed": 8}
    return scenarios.load(name, {**detecting, **changes})


IDEAL = pytest.param(
    "ideal", marks=pytest.mark.release("compiles loops of its own for 20 s; electronics has the same")
)


@pytest.mark.parametrize(("mode", "name"), [("open", DETECTED_OPEN), ("short", DETECTED_SHORTED)])
@pytest.mark.parametrize("hardware", ["electronics", IDEAL])
def test_every_group_that_fails_is_found_and_named_and_no_other(hardware, mode, name):
    """In nutation, which asks every group for more than twice the threshold within a tenth of a second."""
    took_s = []
    for group in range(GROUPS):
        fault = {"target": f"coil.{group:02d}", "mode": mode, "start_s": START_S}
        run = simulate(scenario(hardware=hardware, fault=[fault], duration=1.8))
        assert run.status == "completed"
        out, delays = run.telemetry["group_out"], run.telemetry["time_to_detection_s"]
        assert out[-1].nonzero()[0].tolist() == [group]
        assert out[-1, group] == name
        took_s.append(delays[-1, group])
        result = np.flatnonzero(out[:, group])[0]
        assert run.telemetry["t_s"][result] == pytest.approx(START_S + took_s[-1], abs=1e-9)
        # From the tick at which it is found on, it is asked for nothing.
        assert run.telemetry["current_command_A"][:result, group].any()
        assert not run.telemetry["current_command_A"][result:, group].any()
    assert max(took_s) <= 0.1
    assert min(took_s) >= 3e-3  # no sooner than the ticks that a healthy current may look like none


MINUTES = 600_000
HOT = {"drive.shutdown_degC": 1e4}  # the sinusoid takes the coils past 155 °C within minutes
SLOW = {"drive.bandwidth_rad_s": 300.0, "nominal.time_constant_s": 1 / 300}
LATE = {"drive.delay_s": 5e-4, "nominal.delay_s": 5e-4}
# An amplifier gives 0.8 A a volt; 4.5 steps of a converter of 16 bits and ±10 V.
OFF_ZERO = {"drive.dac_offset_V": 0.5, "nominal.offset_error_A": 0.8 * (1e-3 + 0.5 + 4.5 * 20 / 2**16)}


def supply(volts):
    """A supply that the controller knows, less the larger drop of the prototype's amplifiers."""
    return {"drive.supply_V": volts, "nominal.swing_V": volts - 4.8}


MANY_TICKS = pytest.mark.release("minutes of simulated time, 1 to 3 s; shorter runs have the same thresholds")
LONG = [
    ("ideal-afsm", "sinusoid", "ideal", MINUTES, {}),
    ("electronics-afsm", "sinusoid", "electronics", MINUTES, HOT),
    ("fuzzy", "sinusoid", "electronics", 60_000, {"controller.law": "adaptive_fuzzy"}),
    ("pd", "sinusoid", "electronics", 60_000, {"controller.law": "pd"}),
    (
        "fast clock", "sinusoid", "electronics", 60_000,
        {"controller.period_s": 2e-4, "plant.step_s": 1e-4, **supply(12.0), **HOT},
    ),
]  # fmt: skip
SHORT = [
    ("nutation", "nutation", "electronics", 5_000, {}),
    ("prototype", "nutation", "prototype", 5_000, {"plant.engine": "lagrangian"}),
    ("weak supply", "sinusoid", "electronics", 60_000, {**supply(8.0), **HOT}),
    ("hardly a supply", "sinusoid", "electronics", 20_000, {**supply(5.1), **HOT}),
    ("none to speak of", "hold", "electronics", 5_000, {**supply(4.9), "controller.law": "pd"}),
    ("bounded", "sinusoid", "electronics", 20_000, {"allocation": "bounded", **HOT}),
    ("slow amplifiers", "sinusoid", "electronics", 20_000, SLOW | HOT),
    ("half a period late", "sinusoid", "electronics", 20_000, LATE | HOT),
    ("far off zero", "sinusoid", "electronics", 20_000, OFF_ZERO | HOT),
]  # fmt: skip


@pytest.mark.parametrize(
    ("label", "name", "hardware", "ticks", "changes"),
    [*(pytest.param(*row, marks=MANY_TICKS) for row in LONG), *SHORT],
)
def test_no_healthy_group_is_ever_found(label, name, hardware, ticks, changes):
    """Under each law, through voltage-limited swings, and where AFSM chatters, for ten minutes."""
    busy, limited, last = 0, 0, 0
    watching = scenario(name, hardware, **{"watchdog.on": False, **changes})
    with Session(watching) as session:
        while session.tick < ticks and session.status == "running":
            table = session.advance(min(2000, ticks - session.tick))
            assert not table["group_out"].any(), f"{label} at {session.t_s:g} s"
            threshold_A = session._runtime._controller.data.supervision.detector.threshold_A
            busy += np.count_nonzero(np.abs(table["current_command_A"]) > 2 * threshold_A)
            if hardware == "electronics":
                limited += np.count_nonzero(table["voltage_limited"])
        last = session.tick
    assert busy > 18 * last / 20  # it had something to look at
    if label == "weak supply":
        assert limited > 18 * last / 4
    if label not in ("hardly a supply", "none to speak of"):  # with which the rotor may fall over
        assert last == ticks


def test_a_supply_that_the_controller_does_not_know_leaves_its_thresholds():
    nominal, weak = scenario(duration=0.1), scenario(duration=0.1, **{"drive.supply_V": 8.0})
    figures = []
    for each in (nominal, weak, scenario(duration=0.1, **supply(8.0))):
        with Session(each) as session:
            detector = session._runtime._controller.data.supervision.detector
            limits = detector.threshold_A, detector.ticks, detector.reach_A
            figures.append([np.asarray(numbers).tolist() for numbers in limits])
    assert figures[0] == figures[1] != figures[2]


def test_what_is_known_is_left_out_from_its_tick_on_and_taken_back():
    reported = {"mode": "open", "reported_to_controller": True, "start_s": 0.1, "end_s": 0.2}
    faults = [{"target": f"coil.{group:02d}", **reported} for group in (2, 9)]
    run = simulate(scenario("sinusoid", fault=faults, duration=0.3, **{"detector.detect": False}))
    table, out = run.telemetry, run.telemetry["group_out"]
    expected = np.zeros_like(out)
    expected[100:200, [2, 9]] = REPORTED
    np.testing.assert_array_equal(out, expected)
    assert not table["current_command_A"][100:200][:, [2, 9]].any()
    assert table["current_command_A"][:100, 2].any()
    assert table["current_command_A"][200:, 2].any()
    assert table["time_to_detection_s"][150, 2] == 0.0


def test_events_of_one_chunk_are_in_the_order_of_time():
    """The detection comes between the start of its fault and that of another one, and a trip before it."""
    signals = (
        Signal("t_s", "s", 1, "time"),
        Signal("fault", "1", 2, "faults", ("coil.00", "coil.01"), ("works", "open")),
        Signal("group_out", "1", 2, "groups", ("group 0", "group 1"), ("in use", "reported", "found open")),
        Signal("time_to_detection_s", "s", 2, "delay", ("group 0", "group 1")),
        Signal("failsafe_reason", "1", 1, "reason", (), ("none", "other")),
        Signal("allocation_scale", "1", 1, "scale"),
    )
    table = Table(signals, np.zeros((60, width(signals))))
    table["t_s"][:] = 1e-3 * np.arange(60)
    table["fault"][10:, 0], table["fault"][50:, 1], table["fault"][55:, 0] = 1, 1, 0
    table["group_out"][30:, 0], table["time_to_detection_s"][30:, 0] = 2, 0.02
    table["failsafe_reason"][20:] = 1
    table["allocation_scale"][:] = 1.0
    events = Events().of(table)
    assert [t_s for t_s, _, _ in events] == pytest.approx([0.01, 0.02, 0.03, 0.05, 0.055])
    assert [(level, text.split()[0]) for _, level, text in events] == [
        ("WARN", "coil.00"),
        ("ERROR", "watchdog:"),
        ("INFO", "group"),
        ("WARN", "coil.01"),
        ("INFO", "coil.00"),
    ]


def test_detect_of_a_fault_is_the_detector():
    fault = {"target": "coil.07", "mode": "open", "start_s": 0.5}
    by_fault = scenario(fault=[{**fault, "detection": True}], duration=1.0, **{"detector.detect": False})
    general = scenario(fault=[fault], duration=1.0)
    one, other = simulate(by_fault).telemetry, simulate(general).telemetry
    assert one.values.tobytes() == other.values.tobytes()
    assert one["group_out"][-1, 7] == DETECTED_OPEN


@pytest.mark.parametrize("hardware", ["electronics", IDEAL])
def test_a_detector_that_finds_nothing_moves_no_bit(hardware):
    """Nor does its noise move any other."""
    plain = scenario(hardware=hardware, duration=1.0, **{"detector.detect": False})
    one, other = simulate(plain).telemetry, simulate(scenario(hardware=hardware, duration=1.0)).telemetry
    for signal in one.signals:
        assert one[signal.name].tobytes() == other[signal.name].tobytes()
