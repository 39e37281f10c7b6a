"""Whatever fails, and whatever comes in: a run ends with a status or is refused, and all rows are numbers."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.faults.targets import TARGETS
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.status import Status
from spheretwin.session import Session

TICKS, PERIOD_S = 60, 1e-3
ENGINES = {"electronics": "mujoco", "ideal": "lagrangian"}
ENDS = {Status.COMPLETED, Status.LEFT_WORKSPACE, Status.DIVERGED, Status.FAILSAFE}
PARTS = [(name, part, mode) for name, target in TARGETS.items() for part in target.names(18)
         for mode in target.modes]  # fmt: skip


def scenario(hardware="electronics", **changes):
    fields = {"hardware": hardware, "plant.engine": ENGINES[hardware], "duration": TICKS * PERIOD_S}
    return scenarios.load("nutation", {**fields, **changes})


def finite_rows(session):
    """Run a session on to its end; return its rows."""
    table = session.advance(TICKS)
    assert session.status in {*ENDS, Status.RUNNING}
    assert np.isfinite(table.values).all()
    return table


@st.composite
def faults(draw):
    """One of any part, in any mode, of any size that is allowed, for any while."""
    name, part, mode = draw(st.sampled_from(PARTS))
    made = {"target": part, "mode": mode, "start_s": PERIOD_S * draw(st.integers(0, 40))}
    if length := draw(st.integers(0, 30)):
        made["end_s"] = made["start_s"] + PERIOD_S * length
    value = TARGETS[name].modes[mode].value
    if mode == "delay":
        made["value"] = PERIOD_S * draw(st.sampled_from([0, 1, 3, 50, 1000]))
    elif value is not None and (value.default is None or draw(st.booleans())):
        ends = [value.least, value.largest, max(value.least, min(0.01, value.largest))]
        made["value"] = float(draw(st.sampled_from(ends) | st.floats(value.least, value.largest)))
    if TARGETS[name].each_group:
        made |= {"reported_to_controller": draw(st.booleans()), "detection": draw(st.booleans())}
    return made


@pytest.mark.parametrize("mode", ["gain", "offset", "noise"])
@pytest.mark.parametrize("name", [name for name in TARGETS if name != "controller"])
def test_many_of_the_largest_at_once(name, mode):
    """On every part of a kind, some one behind the other, with all that is allowed of each."""
    target = TARGETS[name]
    if mode not in target.modes:
        return
    many = [
        {"target": part, "mode": each, "value": target.modes[each].value.largest}
        for each in [*((mode,) * 20 if mode != "gain" else ()), *("gain",) * 3]
        for part in target.names(18)
    ]
    for watching in (False, True):
        with Session(scenario(fault=many, **{"watchdog.on": watching})) as session:
            finite_rows(session)


def test_gains_without_an_end_are_refused_and_one_after_the_other_are_not():
    def gain(start_s, end_s):
        return {"target": "adc", "mode": "gain", "value": 100.0, "start_s": start_s, "end_s": end_s}

    with pytest.raises(InputError, match=r"gains of at most 1e\+06 in all for faults of adc at 0\.3 s"):
        scenario(fault=[gain(0.1 * place, 1.0) for place in range(4)])
    scenario(fault=[gain(0.1 * place, 1.0) for place in range(3)])
    scenario(fault=[gain(0.1 * place, 0.1 * place + 0.1) for place in range(50)])


BAD = st.sampled_from([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e200, 1e12, 5e-324, -0.0])

# Whatever a tick goes on from, by what it belongs to.
INPUTS = {
    "angle": lambda machine: machine._plant.rotor.q,
    "rate": lambda machine: machine._plant.rotor.qdot,
    "current": lambda machine: machine._plant.current,
    "temperature": lambda machine: machine._plant.drive.coil.temperature_degC,
    "resistance": lambda machine: machine._plant.drive.coil.resistance_ohm,
    "on their way": lambda machine: machine._plant.drive.delay.history.ravel(),
    "held": lambda machine: machine._plant.drive.stages["dac"].line.last,
    "group gain": lambda machine: machine._plant.group_gain,
    "estimate": lambda machine: machine._controller.estimator_memory,
    "law": lambda machine: machine._controller.memory,
    "belief": lambda machine: machine.rows[0].controller.applied_torque.current,
    "detector": lambda machine: machine.rows[0].controller.supervision.detector.shorted_A,
    "wiper": lambda machine: machine.rows[0].sensors.stages["potentiometer"].line.last,
    "converted": lambda machine: machine.rows[0].sensors.stages["adc"].delayed_rad.ravel(),
    "seen": lambda machine: machine.rows[0].controller.supervision.watchdog.last_rad,
}

PLAN = [
    {"target": "dac.03", "mode": "stuck", "start_s": 0.02},
    {"target": "pot.alpha", "mode": "stuck", "start_s": 0.02, "end_s": 0.03},
    {"target": "adc", "mode": "delay", "value": 2e-3, "start_s": 0.02},
    {"target": "coil.04", "mode": "short"},
    {"target": "supply", "mode": "noise", "value": 1.0},
]


@pytest.mark.parametrize("watching", [False, True])
@pytest.mark.parametrize("what", list(INPUTS))
@settings(max_examples=30)
@given(st.integers(0, 100), BAD, st.integers(0, 25))
def test_any_value_in_any_place_ends_with_a_status_and_numbers(what, watching, place, bad, tick):
    with Session(scenario(fault=PLAN, **{"watchdog.on": watching, "detector.detect": True})) as session:
        session.advance(tick)
        array = INPUTS[what](session._runtime)
        array[place % len(array)] = bad
        finite_rows(session)


@pytest.mark.parametrize("watching", [False, True])
@settings(max_examples=40)
@given(st.integers(0, 7), BAD, st.integers(0, 20))
def test_any_draw_ends_with_a_status_and_numbers(watching, column, bad, tick):
    """Of the sensors, and of faults: no generator gives it, but a generator is not all that may break."""
    with Session(scenario(fault=PLAN, **{"watchdog.on": watching})) as session:
        session.advance(tick)
        inputs = session._inputs.rows(tick, 1)
        for rows in (inputs.noise, inputs.fault_noise):
            rows[0, column % rows.shape[1]] = bad
        inputs.fault_noise[0, 0] = bad  # of the supply, the only fault with noise
        finite_rows(session)
        assert not (np.isnan(bad) and session.status == Status.RUNNING)


LOGGED = tuple(Signal(name, "1", 1, name) for name in ("calls", "bad", "own"))


@numba.njit
def spoiling(t, reference, measurement, parameters, state, torque):
    state[0] += 1.0
    for axis in range(3):
        error = measurement[0, axis] - reference[0, axis]
        torque[axis] = -0.5 * error - 0.05 * (measurement[1, axis] - reference[1, axis])
    if state[0] == parameters[0]:
        bad = state[1]
        if parameters[1] == 0:
            torque[int(parameters[2])] = bad
        elif parameters[1] == 1:
            measurement[int(parameters[2]), 1] = bad
        elif parameters[1] == 2:
            reference[int(parameters[2]), 1] = bad
        else:
            state[2] = bad


@pytest.mark.parametrize(
    ("hardware", "watching"), [("electronics", False), ("electronics", True), ("ideal", False)]
)
@settings(max_examples=40)
@given(st.integers(1, 50), st.integers(0, 3), st.integers(0, 2), BAD)
def test_any_law_ends_with_a_status_and_numbers(hardware, watching, tick, where, axis, bad):
    law = Law("spoiling", spoiling, np.array([tick, where, axis], float), np.zeros(3), LOGGED)
    with Session(scenario(hardware, **{"watchdog.on": watching}), law) as session:
        session._runtime._controller.memory[1] = bad
        finite_rows(session)


class Broken:
    """A path on which one sample is another value."""

    def __init__(self, tick, row, bad):
        self.tick, self.row, self.bad = tick, row, bad

    def sample(self, t):
        made = np.zeros((len(t), 3, 3))
        made[:, 0, 0] = 0.1 * np.sin(t)
        made[np.rint(t / PERIOD_S) == self.tick, self.row, 1] = self.bad
        return made


@pytest.mark.parametrize("watching", [False, True])
@settings(max_examples=40)
@given(st.integers(0, 50), st.integers(0, 2), BAD)
def test_any_trajectory_is_refused_or_ends_with_a_status_and_numbers(watching, tick, row, bad):
    path, changes = Broken(tick, row, bad), {"watchdog.on": watching}
    no_start = row == 0 and not abs(bad) < 1  # no pose to start from
    if tick == 0 and (no_start or not np.isfinite(bad)):
        with pytest.raises(InputError, match=None if no_start else "finite"):
            Session(scenario(**changes), trajectory=path).advance(0 if no_start else TICKS)
        return
    with Session(scenario(**changes), trajectory=path) as session:
        table = finite_rows(session)
        if not np.isfinite(bad):  # all that there is before it is handed over; then it is said
            assert len(table) == tick
            with pytest.raises(InputError, match="finite"):
                session.advance(1)
