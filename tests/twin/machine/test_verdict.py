"""Verdict on logs: correct ones are accepted, each error is found, named and advised on."""

from dataclasses import replace
from itertools import permutations, product
from pathlib import Path

import numpy as np
import pytest

import spheretwin as st
from spheretwin import machine
from spheretwin.machine.diagnosis import AXES, FEWEST_WINDOWS
from spheretwin.machine.findings import FINDINGS, Evidence, check_names
from spheretwin.machine.log import log_of
from spheretwin.machine.verdict import model_of_log
from spheretwin.models.base.errors import InputError
from tests.twin.machine.logs import MULTISINE, multisine, relabelled, run

RANDOM = np.random.default_rng(0)


@pytest.fixture
def log():
    return multisine()


def errors(log, scenario="hold", severity="error"):
    return {f.name: f for f in machine.check(log, scenario).findings if f.severity == severity}


def stated(name, log):
    """Severities and places of one finding, without the others, some of which need the torque balance."""
    result = FINDINGS[name](Evidence(log, model_of_log(log, "hold")))
    return [(severity, where) for severity, where, _ in result]


# --- correct logs


@pytest.mark.parametrize("hardware", ["ideal", "electronics", "prototype"])
def test_a_correct_log_has_no_finding(hardware):
    # The scenario of the check knows neither friction nor the scatter that the prototype's seed draws.
    verdict = machine.check(multisine(hardware), "hold")
    assert verdict.accepted
    assert [f.name for f in verdict.findings] in ([], ["unverified"])
    assert (verdict.rows, verdict.rate_Hz) == (1500, pytest.approx(1000))


@pytest.mark.parametrize(
    ("scenario", "hardware", "duration"),
    [("nutation", "ideal", 2.0), ("tilt", "electronics", 2.5), ("sinusoid", "prototype", 3.0)],
)
def test_correct_logs_of_shipped_scenarios_are_accepted(scenario, hardware, duration):
    """Under loads and random torques that the check does not know."""
    verdict = machine.check(log_of(run(scenario, hardware, (("duration", duration),)).telemetry), scenario)
    assert verdict.accepted, verdict.findings
    assert {f.name for f in verdict.findings} <= {"saturation", "lack-of-excitation", "unverified"}


def test_an_unknown_payload_is_no_error():
    log = log_of(run("tilt", "electronics", (("duration", 2.5),)).telemetry)
    assert machine.check(log, "hold").accepted  # the tilt has a payload, hold has none


# --- order and signs


PAIRS = [((1, 0, 2), (1, 1, 1)), ((2, 1, 0), (1, 1, 1)), ((0, 2, 1), (1, 1, 1))]
SIGNS = [((0, 1, 2), signs) for signs in ((-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, 1))]


@pytest.mark.parametrize(("order", "signs"), [*PAIRS, *SIGNS, ((1, 2, 0), (1, -1, 1))])
def test_order_and_signs_of_axes_are_found(order, signs, log):
    result = errors(replace(log, angle_rad=relabelled(log, order, signs)))
    assert list(result) == ["axes"]
    assert f"angles.sign to {list(signs)}" in result["axes"].advice
    named = ", ".join(["alpha", "beta", "gamma"][place] for place in order)
    assert f"to those of {named}," in result["axes"].advice


def test_the_tested_readings_are_all_orders_and_signs():
    assert set(AXES) == set(product(permutations(range(3)), product((1, -1), repeat=3)))


EXCHANGED = [*range(3), 7, *range(4, 7), 3, *range(8, 18)]
GROUP_CASES = {
    "exchange": (EXCHANGED, np.ones(18, int)),
    "sign": (np.arange(18), np.where(np.arange(18) == 5, -1, 1)),
    "all signs": (np.arange(18), -np.ones(18, int)),
    "reversed": (np.arange(18)[::-1], np.ones(18, int)),
    "any": (RANDOM.permutation(18), RANDOM.choice([-1, 1], 18)),
}


@pytest.mark.parametrize("case", GROUP_CASES)
def test_order_and_signs_of_groups_are_found(case):
    # Without friction, a negative inertia would explain currents with all signs changed.
    log = multisine("ideal" if case == "all signs" else "electronics")
    order, signs = map(np.array, GROUP_CASES[case])
    currents = np.empty_like(log.current_A)
    currents[:, order] = log.current_A * signs
    result = errors(replace(log, current_A=currents))
    assert list(result) == ["groups"]
    advice = f"set currents.columns to the order {order.tolist()}, currents.sign to {signs.tolist()}"
    assert result["groups"].advice == advice


def test_axes_and_groups_are_found_together(log):
    angles = relabelled(log, (1, 0, 2), (1, 1, 1))
    both = replace(log, current_A=log.current_A[:, EXCHANGED], angle_rad=angles)
    assert list(errors(both)) == ["axes", "groups"]


# --- units


@pytest.mark.parametrize("amplitude", ["beyond the range", "within it"])
def test_degrees_are_found(amplitude, log):
    if amplitude == "within it":
        # A motion that stays within the range of the hinges in either unit: 1 degree.
        small = {"trajectory.components": [{"amplitude_rad": [0.01] * 3, "frequency_Hz": [3.1, 2.3, 4.3]}]}
        log = log_of(st.simulate("hold", {**MULTISINE, **small}).telemetry)
    result = errors(replace(log, angle_rad=np.degrees(log.angle_rad)))
    assert list(result) == ["angle-unit"]
    assert "angles.unit to deg" in result["angle-unit"].advice


def test_milliamperes_and_milliseconds_are_found(log):
    result = errors(replace(log, current_A=1e3 * log.current_A))
    assert "currents.unit to mA" in result["current-unit"].advice
    result = errors(replace(log, t_s=1e3 * log.t_s))
    assert list(result) == ["time-unit"]
    assert result["time-unit"].advice.startswith("set time.unit to ms")


# --- time


@pytest.mark.parametrize("late_s", [-0.05, 0.012, 0.1])
def test_a_clock_offset_is_found(late_s, log):
    shifted = np.stack([np.interp(log.t_s - late_s, log.t_s, column) for column in log.current_A.T], axis=1)
    result = errors(replace(log, current_A=shifted))
    assert list(result) == ["clock-offset"]
    said, unit, side = result["clock-offset"].where.split(" ")[1:4]
    assert (unit, side) == ("ms", "after" if late_s > 0 else "before")
    # The lag of the coils, half a period of the interpolated steps and the friction add up to 2 ms.
    assert float(said) == pytest.approx(1e3 * abs(late_s), abs=2)


def changed_times(row, t_s):
    log = multisine()
    times = log.t_s.copy()
    times[row] = t_s
    return replace(log, t_s=times)


def rows_of(rows):
    log = multisine()
    return machine.Log(log.t_s[rows], log.current_A[rows], log.angle_rad[rows])


def without(rows):
    return rows_of(np.delete(np.arange(1500), rows))


def test_gaps_are_found_and_nothing_is_computed_across_them():
    logs = (multisine(), without(np.s_[600:800]))
    whole, parts = (Evidence(log, model_of_log(log, "hold")).diagnosis.unexplained for log in logs)
    assert parts < 2 * whole  # 700 times if the angles are interpolated
    assert list(errors(without(np.s_[600:800]))) == ["gaps"]


@pytest.mark.parametrize("late_s", [1e12, 1e19, 1e300, 1.7e308])
def test_a_time_that_no_clock_has_is_a_gap_and_no_other_error(late_s):
    t_s = np.arange(1200) * 1e-3
    t_s[-1] = late_s
    log = machine.Log(t_s, RANDOM.normal(size=(1200, 18)), RANDOM.normal(size=(1200, 3)))
    assert "gaps" in errors(log)


def jittered(size_s):
    log = multisine()
    return replace(log, t_s=np.sort(log.t_s + RANDOM.uniform(-size_s, size_s, 1500)))


def lacking(rows, value):
    currents = multisine().current_A.copy()
    currents[rows, 4] = value
    return replace(multisine(), current_A=currents)


def largest(current_A, **changes):
    log = multisine()
    return replace(log, current_A=current_A / np.abs(log.current_A).max() * log.current_A, **changes)


@pytest.mark.parametrize(
    ("name", "log", "severity", "where"),
    [
        ("time-order", lambda: changed_times(700, 0.5), "error", "log: 1 times, first after 0.699 s"),
        ("time-order", lambda: changed_times(700, np.nan), "error", "t_s: 1 rows without a time"),
        ("duplicates", lambda: changed_times(900, 0.899), "error", "log: 1 rows, first at 0.899 s"),
        ("gaps", lambda: without(np.s_[600:800]), "error",
         "log: 1, 0.13 of the time, longest 0.201 s at 0.599 s"),
        ("gaps", lambda: without(np.s_[600:604]), "warning",
         "log: 1, 0.0033 of the time, longest 0.005 s at 0.599 s"),
        ("rate", lambda: rows_of(np.s_[::20]), "error", ""),
        ("rate", lambda: rows_of(np.s_[::2]), "warning", "t_s: 500 Hz, control at 1000 Hz"),
        ("jitter", lambda: jittered(3e-4), "warning", ""),
        ("jitter", lambda: jittered(2e-3), "error", ""),
        ("missing-values", lambda: lacking(100, np.nan), "warning", "currents: 1 rows lack some numbers"),
        ("missing-values", lambda: lacking(slice(None), np.inf), "error", "currents: no number in column 4"),
        ("saturation", lambda: largest(12), "error", "currents: commands up to 12 A, limit 8 A"),
        ("saturation", lambda: replace(largest(40), current_A=np.clip(largest(40).current_A, -8, 8)),
         "warning", "currents: at the limit of 8 A in"),
    ],
)  # fmt: skip
def test_rows_that_are_wrong_are_found(name, log, severity, where):
    ((result, place),) = stated(name, log())
    assert (result, place[: len(where)]) == (severity, where)
    if severity == "error":
        assert name in errors(log())


def test_measured_currents_do_not_saturate():
    assert stated("saturation", largest(12, currents="measured")) == []


def test_angles_and_currents_may_have_rows_of_their_own(log):
    t_s = np.sort(np.concatenate([log.t_s, log.t_s + 3e-4]))
    currents, angles = np.full((3000, 18), np.nan), np.full((3000, 3), np.nan)
    currents[1::2], angles[::2] = log.current_A, log.angle_rad
    assert machine.check(machine.Log(t_s, currents, angles), "hold").accepted


# --- content


def test_a_log_without_motion_lacks_excitation(log):
    noise = RANDOM.normal(scale=3e-4, size=(1500, 3))
    assert list(errors(replace(log, angle_rad=noise))) == ["lack-of-excitation"]
    # A single transient fits wrong readings by chance: none is tried.
    result = errors(log_of(run("hold", "electronics", (("duration", 1.0),)).telemetry))
    assert f"{FEWEST_WINDOWS} are the least" in result["lack-of-excitation"].where


def test_axes_that_do_not_move_are_named():
    result = errors(log_of(run("tilt", "electronics", (("duration", 2.5),)).telemetry), "tilt", "warning")
    assert result["lack-of-excitation"].where.startswith("beta, gamma:")
    assert "order of beta and gamma" in result["unverified"].where


def test_currents_that_explain_nothing_are_refused(log):
    assert list(errors(replace(log, current_A=RANDOM.normal(size=(1500, 18))))) == ["torque-balance"]
    assert list(errors(replace(log, current_A=0 * log.current_A))) == ["torque-balance"]


@pytest.mark.parametrize("rows", [2, 3, 50])
def test_short_logs_are_refused(rows):
    assert list(errors(multisine().rows(0, rows))) == ["lack-of-excitation"]


def test_absurd_numbers_are_refused(log):
    huge = replace(log, angle_rad=1e200 * log.angle_rad, current_A=1e200 * log.current_A)
    assert list(errors(huge)) == ["angle-unit", "current-unit"]
    nothing = machine.Log(log.t_s, np.nan * log.current_A, np.nan * log.angle_rad)
    assert list(errors(nothing)) == ["missing-values"]
    assert list(errors(replace(log, t_s=log.t_s[::-1]))) == ["time-order"]


# --- verdict


def test_an_accepted_finding_is_recorded():
    log = changed_times(900, 0.899)
    assert not machine.check(log, "hold").accepted
    verdict = machine.check(replace(log, accepted=("duplicates",)), "hold")
    assert verdict.accepted
    assert [f.name for f in verdict.findings] == ["duplicates"]
    assert verdict.accepted_findings == ("duplicates",)


def test_conditions_belong_to_the_machine():
    with pytest.raises(InputError, match="with the conditions of log"):
        machine.check(replace(multisine(), conditions={"plant.payload": 0.1}), "hold")
    log = replace(multisine(), conditions={"drive.current_limit_A": 5.5})
    assert model_of_log(log, "hold").scenario.drive.current_limit_A == 5.5


def test_names_of_findings_and_groups_are_checked(log):
    assert check_names(["gaps", "gaps", "rate"]) == ("gaps", "rate")
    with pytest.raises(InputError, match="did you mean gaps"):
        check_names(["gap"])
    with pytest.raises(InputError, match="expected currents of 18 groups, received 12"):
        machine.check(replace(log, current_A=log.current_A[:, :12]), "hold")


def test_every_finding_has_a_test_here():
    source = Path(__file__).read_text(encoding="utf-8")
    assert [name for name in FINDINGS if f'"{name}"' not in source] == []
