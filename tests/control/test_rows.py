"""Set-up of many controllers at once: every row is that of a single one."""

import numpy as np
import pytest

from spheretwin.control.applied_torque import AppliedTorque, fill_applied_torque
from spheretwin.control.compensators.feed_forward import (
    FeedForward,
    FeedForwardSection,
    NominalRotor,
    fill_feed_forward,
)
from spheretwin.control.compensators.prediction import (
    DelayModel,
    Prediction,
    PredictionSection,
    fill_prediction,
)
from spheretwin.control.compensators.reference_governor import Governor, GovernorSection, fill_governor
from spheretwin.control.manual_currents import ManualSection, sample_currents
from spheretwin.control.supervision.enabled_groups import REPORTED, EnabledGroups, mark_faulty_groups
from spheretwin.control.supervision.fault_detector import (
    Detector,
    DetectorSection,
    NominalCurrents,
    fill_detector,
)
from spheretwin.control.supervision.watchdog import (
    MeasurementLimits,
    Watchdog,
    WatchdogSection,
    fill_watchdog,
)

SIZES = {"groups": 4, "lines": 2, "delays": 8}
OF_GROUPS = (1e-3, 2e-3, 3e-3, 0.0)
AXES = np.array([1.0, 2.0, 3.0])
CURRENTS = NominalCurrents(1e-3, 8.0, 0.01, 0.02, OF_GROUPS, 20.0, (1.0, 2.0, 3.0, 4.0), 1e-3)
RANGES = np.array([[-1.0, 1.0], [-2.0, 2.0], [-np.inf, np.inf]])
CASES = [
    (AppliedTorque, fill_applied_torque, (True, 1e-3, 2.3e-3, OF_GROUPS)),
    (Governor, fill_governor, (GovernorSection(acceleration_rad_s2=(1.0, 2.0, 3.0)), 1e-3)),
    (Prediction, fill_prediction, (PredictionSection(on=True), DelayModel(1e-3, 2e-3, OF_GROUPS, AXES))),
    (
        FeedForward,
        fill_feed_forward,
        (FeedForwardSection(friction=(0.1, 0.2, 0.3)), NominalRotor(AXES, AXES, AXES), 1e-3, 2.3e-3),
    ),
    (Detector, fill_detector, (DetectorSection(), True, CURRENTS)),
    (Watchdog, fill_watchdog, (WatchdogSection(on=True), MeasurementLimits(1e-3, AXES, AXES, RANGES))),
]


@pytest.mark.parametrize(("kind", "fill", "arguments"), CASES, ids=[case[0].__name__ for case in CASES])
def test_every_row_is_that_of_one_controller(kind, fill, arguments):
    rows, one = kind.zeros(3, **SIZES), kind.filled(fill, *arguments, **SIZES)
    fill(rows, *arguments)
    assert rows.tobytes() == 3 * one.tobytes() != 3 * kind.zeros(**SIZES).tobytes()


def test_faulty_groups_are_marked_in_each_row():
    rows = EnabledGroups.zeros(2, groups=3)
    mark_faulty_groups(rows, np.array([[False, True, False], [True, False, False]]), np.float64(0.5))
    np.testing.assert_array_equal(rows["out"], [[0, REPORTED, 0], [REPORTED, 0, 0]])
    np.testing.assert_array_equal(rows["out_s"], [[0.0, 0.5, 0.0], [0.5, 0.0, 0.0]])


def test_no_manual_currents_are_none_at_each_time():
    assert sample_currents(ManualSection(), np.zeros(5)).shape == (5, 0)
    constant = sample_currents(ManualSection(currents_A=(0.5, -4.0)), np.array([0.0, 1e6]))
    np.testing.assert_array_equal(constant, [[0.5, -4.0]] * 2)
