"""Plausibility of the motion: frozen angles and χ²; test_programs.py has a machine in C."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.supervision.watchdog import Reason
from spheretwin.machine.link.limits import (
    MOST_MISSING,
    FrozenAngles,
    MachineLimits,
    MotionCheck,
    Plausibility,
)
from spheretwin.machine.state_estimation import Shadow, signals
from spheretwin.models.telemetry.table import Table
from spheretwin.session import Session

STILL, NO_CURRENT = np.array([0.1, 0.2, 0.3]), np.zeros(18)


def resolved(**changes):
    with Session(scenarios.load("hold", changes)) as session:
        return session.initial_scenario


@pytest.fixture(scope="module")
def prototype():
    return resolved(hardware="prototype")


def test_identical_measurements_of_a_noisy_sensor_are_frozen(prototype):
    check = FrozenAngles(prototype.nominal, 20)
    assert [check.advance(STILL.copy()) for _ in range(22)] == [False] * 19 + [True] * 3
    assert not check.advance(np.nextafter(STILL, 1.0))  # one bit is a motion
    assert [check.advance(STILL) for _ in range(20)] == [False] * 19 + [True]


# At rest in the middle of a step of 1 mrad: 0.17 mrad of noise stay in it with 0.997, 0.5 mrad with 0.68. On
# three hinges the latter is 2e-10 for 20 measurements, and 1e-14 for 30.
@pytest.mark.parametrize(
    ("noise_mrad", "step_mrad", "ticks", "expected"),
    [(0.0, 0.0, 20, False), (0.0, 3.0, 20, False), (0.3, 0.0, 2, True), (0.17, 1.0, 20, False),
     (0.5, 1.0, 20, False), (0.5, 1.0, 30, True)],
)  # fmt: skip
def test_only_expected_noise_can_be_missing(prototype, noise_mrad, step_mrad, ticks, expected):
    sheet = {"angle_noise_rad": (1e-3 * noise_mrad,) * 3, "angle_resolution_rad": (1e-3 * step_mrad,) * 3}
    check = FrozenAngles(prototype.nominal.model_copy(update=sheet), ticks)
    assert check.noise_is_expected == expected
    assert [check.advance(STILL) for _ in range(ticks)][-1] == expected


def block(innovation_rad, normalised, rate_rad_s=0.0, measured=0.0):
    """A block of the shadow's telemetry of 20 equal rows."""
    values = {
        "innovation_rad": innovation_rad,
        "innovation_normalised": normalised,
        "qdot_estimated_rad_s": rate_rad_s,
        "q_measured_rad": measured,
    }
    columns = [np.tile(np.broadcast_to(values.get(signal.name, 0.0), signal.size), (20, 1)) for signal in
               signals(offsets=False)]  # fmt: skip
    return Table(signals(offsets=False), np.hstack(columns))


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (block((3e-3, 0.0, 0.0), (3.0, 0.0, 0.0)), 9.0),
        (block((3e-3, 8e-3, 1e-3), (3.0, 8.0, 1.0)), 64.0),  # the largest of the hinges
        # Noise of 3 mrad and 4 mrad of motion in a period: 10 mrad are twice the 5 mrad that are expected.
        (block(10e-3, 10 / 3, rate_rad_s=4.0), 4.0),
        (block(np.nan, np.nan, measured=np.nan), 0.0),  # no measurement
        (block(np.nan, np.nan), np.inf),  # the estimate has diverged
        (block(0.0, 0.0), 0.0),
    ],
)
def test_chi2_is_the_largest_mean_square(prototype, rows, expected):
    check = MotionCheck(Shadow("hold"), 1e-3)
    check._take(rows)
    assert check.chi2 == check.largest_chi2 == pytest.approx(expected)
    check._take(block(0.0, 0.0))
    assert check.largest_chi2 == pytest.approx(expected)


@pytest.mark.uncompiled
def test_a_motion_without_a_cause_contradicts_the_model():
    """The rotor rests, then turns by 0.1 rad in a millisecond without currents: a hundred times the noise."""
    scenario = scenarios.load("hold")
    limits = MachineLimits(current_A=1.0)
    check = Plausibility.of(scenario, resolved(), limits)
    rehearsed = check.unlimited()
    reasons = [
        check.advance(1e-3 * tick, NO_CURRENT, STILL + (0.1 if tick >= 40 else 0.0)) for tick in range(60)
    ]
    assert reasons == [Reason.NONE] * 59 + [Reason.MODEL]
    assert check.largest_chi2 > limits.chi2
    assert all(
        rehearsed.advance(1e-3 * tick, NO_CURRENT, STILL + 0.1 * (tick >= 40)) == Reason.NONE
        for tick in range(60)
    )


def jump_after(ticks, **flags):
    """Reasons for a rotor that is elsewhere after `ticks` without a measurement, or after a pause."""
    check = Plausibility.of(scenarios.load("hold"), resolved(), MachineLimits(current_A=1.0))
    found = [check.advance(1e-3 * tick, NO_CURRENT, STILL) for tick in range(40)]
    found += [check.advance(1e-3 * tick, NO_CURRENT, np.full(3, np.nan)) for tick in range(40, 40 + ticks)]
    found.append(check.advance(1e-3 * (40 + ticks), NO_CURRENT, STILL + 0.1, **flags))
    found += [check.advance(1e-3 * tick, NO_CURRENT, STILL + 0.1) for tick in range(41 + ticks, 90)]
    return set(found)


@pytest.mark.uncompiled
def test_the_motion_during_a_pause_is_not_judged():
    assert jump_after(0) == jump_after(MOST_MISSING) == {Reason.NONE, Reason.MODEL}
    assert jump_after(MOST_MISSING + 1) == jump_after(0, after_pause=True) == {Reason.NONE}


def test_a_missing_measurement_is_not_frozen(prototype):
    check = Plausibility.of(
        scenarios.load("hold", {"hardware": "prototype"}),
        prototype,
        MachineLimits(current_A=1.0, frozen_ticks=6),
    )
    missing = np.full(3, np.nan)
    assert [check.advance(1e-3 * tick, NO_CURRENT, missing) for tick in range(5)] == [Reason.NONE] * 5
    reasons = [check.advance(1e-3 * tick, NO_CURRENT, STILL) for tick in range(5, 11)]
    assert reasons == [Reason.NONE] * 5 + [Reason.FROZEN]
