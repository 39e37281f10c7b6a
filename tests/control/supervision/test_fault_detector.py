"""The detector: threshold and ticks as derived, and what each tick says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin.control.supervision.enabled_groups import (
    DETECTED_OPEN,
    DETECTED_SHORTED,
    IN_USE,
    REPORTED,
    EnabledGroups,
)
from spheretwin.control.supervision.fault_detector import (
    Detector,
    DetectorSection,
    NominalCurrents,
    derived_threshold_A,
    derived_ticks,
    detect_faults,
    fill_detector,
)
from spheretwin.electronics.amplifier import Amplifier, AmplifierSection, Flow, drive_coils, fill_amplifier
from spheretwin.electronics.coil import CoilSection, GroupCoils, fill_coils
from spheretwin.electronics.converters import Dac, convert, fill_dac
from spheretwin.electronics.drive_section import DriveSection, ResolvedDrive, drive_sheet
from spheretwin.models.base.record import set_states, states_of
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.magnetics import torque_matrix
from spheretwin.scenario.hardware import PROTOTYPE_DRIVE

COUNT, R_OHM, L_H, PERIOD_S = 18, 1.3, 0.9e-3, 1e-3
THERMAL = {"resistance_per_K": 0.0, "heat_capacity_J_K": 60.0, "thermal_resistance_K_W": 4.0}
PROTOTYPE = NominalCurrents(
    period_s=PERIOD_S,
    current_limit_A=8.0,
    static_error_A=0.8 * (1e-3 + 2e-3 + 4.5 * 20 / 2**16 + 1e-3 * 10),
    noise_A=0.02,
    time_constant_s=1 / (2 * np.pi * 2000),
    swing_V=24 - 4.8,
    resistance_ohm=R_OHM,
    inductance_H=L_H,
)
POSE, STILL = np.array([0.3, -0.2, 0.5]), np.zeros(3)


def rows_of(nominal=PROTOTYPE, **section):
    return Detector.filled(fill_detector, DetectorSection(**section), True, nominal, groups=COUNT)


def made(nominal=PROTOTYPE, **section):
    return rows_of(nominal, **section)[0]


def groups():
    return EnabledGroups.zeros(groups=COUNT)[0]


def test_the_prototype_s_threshold_and_ticks():
    assert derived_threshold_A(PROTOTYPE) == pytest.approx(PROTOTYPE.static_error_A + 6 * 0.02)
    # 16 A at 8.8 V over 0.9 mH is 1.64 ms, five time constants 0.40 ms: 3 ticks, and one more.
    assert derived_ticks(PROTOTYPE) == 4
    ideal = PROTOTYPE._replace(
        static_error_A=0.0, noise_A=0.0, swing_V=np.inf, time_constant_s=L_H / R_OHM
    )  # fmt: skip
    assert derived_threshold_A(ideal) == pytest.approx(0.08)  # 1 % of the limit
    assert derived_ticks(ideal) == 1 + int(np.ceil(5 * L_H / R_OHM / PERIOD_S))
    assert derived_ticks(ideal._replace(time_constant_s=0.0)) == 1
    given = made(threshold_A=0.3, ticks=9)
    assert (given.threshold_A, given.ticks) == (0.3, 9)


def test_each_group_has_the_model_current_of_its_own_coils():
    R, L = np.linspace(5.7, 8.3, COUNT), np.linspace(4e-4, 2e-2, COUNT)
    nominal = PROTOTYPE._replace(resistance_ohm=tuple(R), inductance_H=tuple(L))
    watcher = made(nominal)
    np.testing.assert_allclose(watcher.decay, np.exp(-PERIOD_S * R / L), rtol=1e-15)
    np.testing.assert_allclose(watcher.reach_A, PROTOTYPE.swing_V / R, rtol=1e-15)
    alone = [
        derived_ticks(PROTOTYPE._replace(resistance_ohm=ohm, inductance_H=henry))
        for ohm, henry in zip(R, L, strict=True)
    ]
    assert watcher.ticks == max(alone) > min(alone)


def test_the_sheet_of_the_prototype_s_drive_is_its_static_error_and_swing():
    fields = {name.removeprefix("drive."): value for name, value in PROTOTYPE_DRIVE.items()}
    fields |= {"resistance_ohm": 1.3, "inductance_H": 0.9e-3, "current_limit_A": 8.0, **THERMAL}
    sheet = drive_sheet(ResolvedDrive(**fields))
    error_A = sheet["offset_error_A"] + sheet["gain_error"] * sheet["current_limit_A"]
    assert error_A == pytest.approx(PROTOTYPE.static_error_A, rel=1e-14)  # a sum of four products
    assert sheet["swing_V"] == PROTOTYPE.swing_V
    assert sheet["time_constant_s"] == pytest.approx(PROTOTYPE.time_constant_s, rel=1e-14)
    # A converter without steps has no error, whatever is stated of it; without a supply there is no limit.
    plain = drive_sheet(ResolvedDrive(**fields | {"dac_bits": 0, "supply_V": None, "time_constant_s": 1e-3}))
    assert plain["offset_error_A"] == pytest.approx(0.8 * 1e-3)
    assert (plain["gain_error"], plain["swing_V"], plain["time_constant_s"]) == (0.0, 0.0, 1e-3)


def test_no_command_of_a_healthy_drive_is_further_off_than_the_static_error():
    section = DriveSection(**{name.removeprefix("drive."): value for name, value in PROTOTYPE_DRIVE.items()})
    worst = 0.0
    for seed in range(40):
        transconductance_A_V = section.transconductance_A_V
        converter = Dac.filled(fill_dac, section, transconductance_A_V, seed, groups=COUNT)[0]
        offsets = Amplifier.filled(fill_amplifier, section, 8.0, PERIOD_S, seed, groups=COUNT)[0].offset_A
        for command in np.linspace(-8, 8, 41):
            asked = np.empty(COUNT)
            convert(converter, np.full(COUNT, command), asked)
            worst = max(worst, np.abs(asked + offsets - command).max())
    # The worst of all errors at once is drawn by no channel, but some come near.
    assert 0.6 * PROTOTYPE.static_error_A < worst <= PROTOTYPE.static_error_A


@settings(max_examples=60)
@given(
    swing_V=st.floats(0.5, 60),
    inductance_H=st.floats(1e-4, 5e-3),
    resistance_ohm=st.floats(0.3, 3),
    bandwidth_rad_s=st.floats(500, 30_000),
    period_s=st.sampled_from([1e-4, 5e-4, 1e-3, 2e-3]),
)
def test_a_healthy_current_looks_like_none_for_fewer_ticks(
    swing_V, inductance_H, resistance_ohm, bandwidth_rad_s, period_s
):
    """From one limit to the other, through an amplifier with that swing: the samples below the threshold."""
    nominal = PROTOTYPE._replace(
        period_s=period_s, swing_V=swing_V, inductance_H=inductance_H, resistance_ohm=resistance_ohm,
        time_constant_s=1 / bandwidth_rad_s,
    )  # fmt: skip
    watcher = made(nominal)
    supplied = AmplifierSection(supply_V=swing_V, bandwidth_rad_s=bandwidth_rad_s)
    stage = Amplifier.filled(fill_amplifier, supplied, 8.0, period_s, 0, groups=1)[0]
    section = CoilSection(resistance_ohm=resistance_ohm, inductance_H=inductance_H, **THERMAL)
    winding = GroupCoils.filled(fill_coils, section, period_s, groups=1)[0]
    reach = min(8.0, swing_V / resistance_ohm)
    current, sums, silent = np.array([-reach]), Flow.zeros(groups=1)[0], 0
    for _ in range(200):
        drive_coils(stage, stage.whole, winding, np.array([8.0]), np.zeros(1), current, sums)
        silent += abs(current[0]) <= watcher.threshold_A
    if min(reach, watcher.reach_A[0]) > 2 * watcher.threshold_A:  # else no tick says anything
        assert silent < watcher.ticks


def hold(watcher, state, measured, believed=2.0, q=POSE, qdot=STILL, t=0.0, actuator=None):
    """Ticks at which all groups are measured and believed alike."""
    watcher.measured_A[:] = measured
    G = torque_matrix(q, actuator) if actuator else np.full((3, COUNT), 0.02)
    detect_faults(watcher, state, np.broadcast_to(believed, COUNT).astype(float), G, q, qdot, t)


def test_a_fault_needs_the_exact_number_of_ticks():
    watcher, state = made(ticks=5), groups()
    for tick in range(5):
        assert not state.out.any()
        hold(watcher, state, 0.01, t=0.1 * tick)
    assert state.out.tolist() == [DETECTED_OPEN] * COUNT
    assert state.out_s.tolist() == [0.4] * COUNT
    assert state.out.any()


def test_a_healthy_tick_resets_the_count_and_a_neutral_one_does_not():
    watcher, state = made(ticks=3), groups()
    for measured, believed, counted in [
        (0.0, 2.0, 1), (0.0, 2.0, 2), (2.0, 2.0, 0), (0.0, 2.0, 1), (0.0, 0.05, 1), (0.05, -0.05, 1),
        (0.0, -2.0, 2), (-1.0, -2.0, 0),
    ]:  # fmt: skip
        hold(watcher, state, measured, believed)
        assert watcher.indications.tolist() == [counted] * COUNT
    assert not state.out.any()


TURNING = np.array([3.0, -4.0, 6.0])


def shorted_currents(actuator, ticks):
    """Currents of shorted coils from rest by their differential equation, with the EMF of a turning rotor."""
    settled = -torque_matrix(POSE, actuator).T @ rate_jacobian(POSE) @ TURNING / R_OHM
    rise = 1 - np.exp(-(np.arange(ticks) + 1) * PERIOD_S * R_OHM / L_H)
    return settled, rise[:, None] * settled


@pytest.mark.parametrize("shorted", [False, True])
def test_a_turning_rotor_distinguishes_open_and_shorted_groups(actuator, shorted):
    watcher, state = made(ticks=6), groups()
    settled, currents = shorted_currents(actuator, 20)
    for current in currents:
        hold(watcher, state, current if shorted else 0.0, 3.0, qdot=TURNING, actuator=actuator)
    told_apart = np.abs(settled) > 0.01
    assert np.count_nonzero(told_apart) > 12
    assert set(state.out[told_apart].tolist()) == {DETECTED_SHORTED if shorted else DETECTED_OPEN}


def test_a_guessed_classification_is_corrected_when_the_rotor_turns(actuator):
    watcher, state = made(ticks=3), groups()
    for _ in range(5):
        hold(watcher, state, 0.0, 3.0, actuator=actuator)
    assert state.out.tolist() == [DETECTED_OPEN] * COUNT  # still, nothing tells them apart
    settled, currents = shorted_currents(actuator, 60)
    for current in currents:
        hold(watcher, state, current, 0.0, qdot=TURNING, actuator=actuator)
    assert set(state.out[np.abs(settled) > 0.03].tolist()) == {DETECTED_SHORTED}


def test_noise_changes_no_correct_classification():
    """Ten seconds of the prototype's noise on open groups of a rotor that just about turns."""
    generator = np.random.default_rng(1)
    watcher, state, names = made(), groups(), []
    for tick in range(10_000):
        qdot = 0.3 * np.ones(3) * np.sin(1e-3 * tick)
        hold(watcher, state, 0.02 * generator.normal(size=COUNT), 3.0, qdot=qdot)
        if state.out.any():
            names.append(state.out.copy())
    assert np.count_nonzero(np.diff(names, axis=0)) <= COUNT  # at most once, where the first name was a guess
    assert set(state.out.tolist()) == {DETECTED_OPEN}


def test_a_reported_group_resets_the_detector():
    watcher, state = made(ticks=3), groups()
    for _ in range(2):
        hold(watcher, state, 0.0)
    state.out[:] = REPORTED
    hold(watcher, state, 0.0)
    state.out[:] = IN_USE
    for _ in range(2):
        hold(watcher, state, 0.0)
    assert not state.out.any()
    assert state.out.tolist() == [IN_USE] * COUNT


@given(
    st.lists(st.sampled_from([0.0, 1e-320, 0.1, 8.0, -8.0, 1e300, np.inf, -np.inf, np.nan]), min_size=3),
    st.sampled_from([0.0, 3.0, 1e300, np.inf, np.nan]),
    st.sampled_from([0.0, 1.0, 1e200, np.nan]),
)
def test_a_non_finite_current_is_no_fault_and_affects_only_its_group(measured, believed, rate):
    watcher, state = made(ticks=2), groups()
    for value in measured:
        everyone = np.full(COUNT, 2.0)
        everyone[3] = value
        wanted = np.full(COUNT, 2.0)
        wanted[3] = believed
        hold(watcher, state, everyone, wanted, qdot=np.full(3, rate))
        if np.isnan(measured).any() or np.isnan(rate):
            assert state.out[3] in (IN_USE, DETECTED_OPEN, DETECTED_SHORTED)
    if not np.isnan(rate):
        assert not np.delete(state.out, 3).any()
    if np.isnan(measured).all():
        assert state.out[3] == IN_USE


def test_the_state_is_complete(actuator):
    one, other = rows_of(), rows_of()
    first, second = (EnabledGroups.zeros(groups=COUNT) for _ in range(2))

    def ticks(watcher, state, seed, count):
        draws = np.random.default_rng(seed)
        for _ in range(count):
            qdot = draws.normal(size=3)
            hold(watcher[0], state[0], draws.normal(size=COUNT) * 0.3, 1.0, qdot=qdot, actuator=actuator)

    ticks(one, first, 85, 7)
    set_states(other, states_of(one))
    set_states(second, states_of(first))
    ticks(one, first, 5, 20)
    ticks(other, second, 5, 20)
    for restored, part in ((other, one), (second, first)):
        assert states_of(restored).tobytes() == states_of(part).tobytes()
