"""Current under a limited voltage: against an ODE solver, energy, two halves, limits, and any input."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from spheretwin.electronics.amplifier import (
    Amplifier,
    AmplifierSection,
    Flow,
    drive_coils,
    fill_amplifier,
    reset_sums,
)
from spheretwin.electronics.coil import CoilSection, CurrentLag, GroupCoils, advance_lag, fill_coils, fill_lag

STEP_S = 5e-4
SUPPLY = {"supply_V": 24.0, "drop_up_V": 4.8, "drop_down_V": 4.6}
PERIOD_S = 1e-3


class Case(NamedTuple):
    """One group in one step."""

    start: float
    setpoint: float
    emf: float
    phases: str  # F follows, U and D are at the upper and the lower limit
    R: float = 1.3
    L: float = 0.9e-3
    rate: float = 12566.370614359172
    highest: float = 19.2
    lowest: float = -19.4
    step_s: float = STEP_S
    limit: float = 8.0


CASES = [
    Case(2.0, 2.5, 1.0, "F"),
    Case(-1.0, -1.2, -3.0, "F"),
    Case(-8.0, 8.0, 0.0, "U"),
    Case(8.0, -8.0, 0.0, "D"),
    Case(0.0, 3.0, 0.0, "UF"),
    Case(0.0, -3.0, 1.0, "DF"),
    Case(6.0, 6.0, 15.0, "U"),  # never enough for the target
    Case(8.5, 8.0, 9.5, "FU"),
    Case(-8.5, -8.0, -9.5, "FD"),
    Case(9.5, 5.0, 15.0, "DFU"),
    Case(-9.5, -5.0, -15.0, "UFD"),
    # Slower than the coil by itself (L rate < R): the voltage falls as the current does.
    Case(6.0, 8.0, 8.0, "F", rate=500.0),
    Case(4.0, 8.0, 9.0, "FU", rate=1000.0, step_s=5e-3),
    Case(-4.0, -8.0, -9.5, "FD", rate=1000.0, step_s=5e-3),
    Case(25.0, 8.0, 2.0, "UF", rate=900.0),
    # A voltage that stays where it is (L rate = R), all but within.
    Case(2.0, 5.0, 1.0, "F", R=1.25, L=1.25e-3, rate=1000.0),
    Case(2.0, 5.0, 15.0, "U", R=1.25, L=1.25e-3, rate=1000.0),
]
NAMES = [f"{case.phases}-{number}" for number, case in enumerate(CASES)]


class Stepped(NamedTuple):
    """What a group has done in a step."""

    current: float
    mean: float
    copper: float
    work: float
    limited: float


def coils_of(resistance_ohm, inductance_H, groups):
    section = CoilSection(
        resistance_ohm=resistance_ohm,
        inductance_H=inductance_H,
        resistance_per_K=0.0,
        heat_capacity_J_K=60.0,
        thermal_resistance_K_W=4.0,
    )
    return GroupCoils.filled(fill_coils, section, PERIOD_S, groups=groups)[0]


def amplifier_of(section, limit_A, step_s, groups, seed=0):
    return Amplifier.filled(fill_amplifier, section, limit_A, step_s, seed, groups=groups)[0]


def zero_flow(groups):
    return Flow.zeros(groups=groups)[0]


def made(case, groups=1):
    """Amplifiers and coils of a case."""
    highest = max(case.highest, -case.lowest)
    section = AmplifierSection(
        supply_V=highest,
        drop_up_V=highest - case.highest,
        drop_down_V=highest + case.lowest,
        bandwidth_rad_s=case.rate,
    )
    coils = coils_of(case.R, case.L, groups)
    return amplifier_of(section, case.limit, case.step_s, groups), coils


def stepped(case, times=1):
    amplifiers, coils = made(case)
    current, passed = np.array([case.start]), zero_flow(1)
    charge = 0.0
    for _ in range(times):
        drive_coils(
            amplifiers,
            amplifiers.whole,
            coils,
            np.array([case.setpoint]),
            np.array([case.emf]),
            current,
            passed,
        )
        charge += passed.mean_current_A[0] * case.step_s
    mean = charge / (times * case.step_s)
    return Stepped(current[0], mean, passed.copper_J[0], passed.work_J[0], passed.voltage_limited_s[0])


def voltage(case, current):
    """What the amplifier would set, had it any voltage."""
    return case.R * current + case.L * case.rate * (case.setpoint - current) + case.emf


def integrated(case):
    """The same by scipy's solver, to 1e-12 a step; and which limits hold, in order."""

    def slope(t, state):
        v = np.clip(voltage(case, state[0]), case.lowest, case.highest)
        i = state[0]
        return [(v - case.R * i - case.emf) / case.L, i, case.R * i**2, v * i]

    ends = [lambda t, state, end=end: voltage(case, state[0]) - end for end in (case.highest, case.lowest)]
    tolerances = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-15, "max_step": case.step_s / 50}
    solution = solve_ivp(slope, (0, case.step_s), [case.start, 0, 0, 0], events=ends, **tolerances)
    assert solution.success
    edges = [0.0, *sorted(np.concatenate(solution.t_events)), case.step_s]
    phases, limited = "", 0.0
    for begin, end in pairwise(edges):
        volts = voltage(case, np.interp((begin + end) / 2, solution.t, solution.y[0]))
        phases += "U" if volts > case.highest else "D" if volts < case.lowest else "F"
        limited += (end - begin) * (phases[-1] != "F")
    current, charge, copper, work = solution.y[:, -1]
    return Stepped(current, charge / case.step_s, copper, work, limited), phases


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_a_step_is_what_an_ode_solver_finds(case):
    expected, phases = integrated(case)
    assert phases == case.phases
    # The solver's 1e-12 a step, over a hundred; each switch is a kink that costs it some of its order.
    np.testing.assert_allclose(stepped(case), expected, rtol=1e-9, atol=1e-12)


def test_with_enough_voltage_the_current_is_the_ideal_lag():
    generator, groups = np.random.default_rng(0), 18
    coils = coils_of(1.3, 0.9e-3, groups)
    for supply_V in (1e6, None):
        section = AmplifierSection(supply_V=supply_V, bandwidth_rad_s=4096.0)  # 1 / rate is exact
        amplifiers = amplifier_of(section, 8.0, STEP_S, groups)
        current, ideal, mean, passed = np.zeros(groups), np.zeros(groups), np.empty(groups), zero_flow(groups)
        for _ in range(100):
            setpoint = generator.uniform(-10, 10, groups)  # some beyond the limit
            drive_coils(
                amplifiers, amplifiers.whole, coils, setpoint, generator.normal(size=groups), current, passed
            )
            lag = CurrentLag.filled(fill_lag, 1 / 4096.0, STEP_S, 8.0, groups=groups)[0]
            advance_lag(lag, setpoint, ideal, mean)
            # Both are the same closed form; the roundings of a few currents of 8 A.
            np.testing.assert_allclose(current, ideal, rtol=0, atol=1e-14)
            np.testing.assert_allclose(passed.mean_current_A, mean, rtol=0, atol=1e-14)
        np.testing.assert_array_equal(passed.voltage_limited_s, 0)


def test_at_rest_nothing_moves_by_a_bit():
    amplifiers, coils = made(Case(0, 0, 0, "F"), groups=3)
    setpoint, passed = np.array([0.0, 3.3, -8.0]), zero_flow(3)
    current = setpoint.copy()
    for _ in range(1000):
        drive_coils(amplifiers, amplifiers.whole, coils, setpoint, np.zeros(3), current, passed)
    np.testing.assert_array_equal(current, setpoint)
    np.testing.assert_allclose(passed.copper_J, 1.3 * setpoint**2 * 0.5, rtol=1e-12)  # 1000 sums


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_step_that_begins_at_a_limit_to_the_bit_and_goes_beyond_stays_there(sign):
    # L rate = 2: the voltage is 2 * 4 - 5 + 5 = 8 V at the start, and would be 4 + 5 = 9 V at the target.
    figures = {"R": 1.0, "L": 0.5, "rate": 4.0, "highest": 8.0, "lowest": -8.0}
    case = Case(5.0 * sign, 4.0 * sign, 5.0 * sign, "", **figures, step_s=0.25)
    after = stepped(case)
    assert after.limited == 0.25
    assert after.current == pytest.approx(sign * (3.0 + 2.0 * np.exp(-0.5)), rel=1e-15)


def decades(lowest, highest):
    return st.floats(lowest, highest).map(lambda exponent: 10.0**exponent)


def signed(numbers):
    return st.one_of(st.just(0.0), numbers, numbers.map(lambda number: -number))


ANY = st.builds(
    Case,
    start=signed(decades(-3, 1.5)),
    setpoint=signed(decades(-3, 1.5)),
    emf=signed(decades(-3, 1.5)),
    phases=st.just(""),
    R=decades(-2, 2),
    L=decades(-6, 0),
    rate=decades(1, 5),
    highest=decades(0, 2),
    lowest=decades(0, 2).map(lambda volts: -volts),
    step_s=decades(-5, -2),
    limit=st.just(1e3),
)


def scales_of(case, *currents):
    """Largest current and power of a step."""
    largest = max(map(abs, currents))
    return largest, max(case.highest, -case.lowest, abs(case.emf), case.R * largest) * largest


@given(ANY)
def test_work_is_copper_loss_and_emf_work_and_the_change_of_what_is_stored(case):
    after = stepped(case)
    emf_work = case.emf * after.mean * case.step_s
    stored = 0.5 * case.L * (after.current**2 - case.start**2)
    largest, power = scales_of(case, case.start, after.current)
    # Rounding of each integral, and of what is stored at either end.
    rounding = 1e-14 * (power * case.step_s + 0.5 * case.L * largest**2)
    assert after.work == pytest.approx(after.copper + emf_work + stored, rel=0, abs=20 * rounding)


@given(ANY)
def test_two_halves_are_one_whole_whatever_the_phases(case):
    whole, halves = stepped(case), stepped(case._replace(step_s=case.step_s / 2), times=2)
    largest, power = scales_of(case, case.start, whole.current, halves.current)
    scales = np.array([largest, largest, power * case.step_s, power * case.step_s])
    # Times are ill-conditioned where a limit is met slowly, or only just: not what they lead to.
    assert np.all(np.abs(np.subtract(halves, whole))[:4] <= 1e-12 * scales)


@given(ANY)
def test_current_goes_towards_its_rest_and_voltage_within_its_swing(case):
    after = stepped(case)
    # At rest: the target, or what the limits allow.
    rest = np.clip(case.setpoint, (case.lowest - case.emf) / case.R, (case.highest - case.emf) / case.R)
    swing = max(case.highest, -case.lowest, abs(case.emf)) / case.R
    slack = 1e-12 * max(abs(case.start), abs(case.setpoint), swing)  # of what the currents are differences of
    low, high = sorted((case.start, rest))
    assert low - slack <= after.current <= high + slack
    assert low - slack <= after.mean <= high + slack
    assert 0 <= after.limited <= case.step_s * (1 + 1e-15)
    assert after.copper >= 0


ANY_NUMBER = st.floats(allow_nan=False)
REACHABLE = st.floats(-1e12, 1e12)  # A: of 1e9 V over 1 mohm


@given(
    st.lists(st.tuples(REACHABLE, ANY_NUMBER, ANY_NUMBER), min_size=4, max_size=4),
    decades(-3, 6),
    decades(-9, 3),
    decades(-3, 9),
    decades(-3, 6),
    decades(-7, 0),
)
def test_no_number_however_large_or_small_gives_anything_but_numbers(groups, R, L, bandwidth, supply, step_s):
    current, setpoint, emf = (np.array(column) for column in zip(*groups, strict=True))
    section = AmplifierSection(supply_V=supply, bandwidth_rad_s=bandwidth)
    amplifiers = amplifier_of(section, 8.0, step_s, 4)
    coils, passed = coils_of(R, L, 4), zero_flow(4)
    most = np.maximum(np.abs(current), (supply + 1e9) / R)
    for _ in range(3):
        drive_coils(amplifiers, amplifiers.whole, coils, setpoint, emf, current, passed)
    for sums in (current, *(passed[name] for name in Flow.fields())):
        assert np.all(np.isfinite(sums))
    assert np.all(np.abs(current) <= most * (1 + 1e-12))
    assert np.all(passed.voltage_limited_s <= 3 * step_s * (1 + 1e-12))


@pytest.mark.parametrize("place", ["setpoint", "emf", "current"])
def test_what_is_not_a_number_stays_so_in_its_group_alone(place):
    amplifiers, coils = made(CASES[0], groups=3)
    inputs = {"setpoint": np.full(3, 2.0), "emf": np.full(3, 0.5), "current": np.zeros(3)}
    inputs[place][1] = np.nan
    passed = zero_flow(3)
    drive_coils(amplifiers, amplifiers.whole, coils, **inputs, flow=passed)
    lost = np.array([False, True, False])
    for sums in (inputs["current"], passed.mean_current_A, passed.copper_J, passed.work_J):
        np.testing.assert_array_equal(np.isnan(sums), lost)


def test_the_target_keeps_to_the_current_limit_with_its_offset():
    section = AmplifierSection(**SUPPLY, amplifier_offset_V=5e-3)
    amplifiers = amplifier_of(section, 8.0, STEP_S, 18, seed=4)
    assert np.all(np.abs(amplifiers.offset_A) <= 4e-3)  # 5 mV at 0.8 A/V
    coils, passed = coils_of(1.3, 0.9e-3, 18), zero_flow(18)
    current = np.zeros(18)
    for setpoint, expected in ((1.0, 1.0 + amplifiers.offset_A), (9.0, 8.0), (-np.inf, -8.0)):
        reset_sums(passed)
        for _ in range(40):
            drive_coils(
                amplifiers, amplifiers.whole, coils, np.full(18, setpoint), np.zeros(18), current, passed
            )
        np.testing.assert_allclose(current, expected, rtol=1e-14)
        limited = 0.0 if setpoint == 1.0 else 40 * STEP_S
        np.testing.assert_allclose(passed.current_limited_s, limited, rtol=1e-13)
    exact, current, passed = made(CASES[0], groups=2)[0], np.array([8.0, -8.0]), zero_flow(2)
    drive_coils(exact, exact.whole, made(CASES[0], groups=2)[1], current.copy(), np.zeros(2), current, passed)
    np.testing.assert_array_equal(passed.current_limited_s, 0)  # the limit itself may be commanded
