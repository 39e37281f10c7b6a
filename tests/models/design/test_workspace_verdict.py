"""The verdict on the workspace: its worst torque, a need it meets or not, and a direction that is lost."""

from dataclasses import replace

import numpy as np
import pytest

from spheretwin.models.base.checks import broken
from spheretwin.models.base.errors import InputError
from spheretwin.models.design import torque_map


@pytest.fixture(scope="module")
def surveyed(actuator):
    return torque_map.survey(actuator, largest_tilt_deg=12)


def test_a_need_is_met_up_to_the_worst_torque(surveyed):
    worst = torque_map.judge(surveyed).weakest[0].least_norm_Nm
    for need_Nm, names in ((0.999 * worst, []), (1.001 * worst, ["need"])):
        verdict = torque_map.judge(surveyed, need_Nm)
        assert broken(verdict.checks) == names
        assert verdict.checks[-1].value == pytest.approx(need_Nm / worst)


def test_a_lost_direction_is_told_and_meets_no_need(actuator):
    # Opposite poles that are unlike cancel: no torque at all is left.
    opposite = np.argmin(actuator.pole_axes @ actuator.pole_axes.T, axis=1)
    polarity = np.where(np.arange(16) < opposite, 1.0, -1.0)
    assert np.all(polarity == -polarity[opposite])
    dead = replace(actuator, pole_polarity=polarity)
    verdict = torque_map.judge(torque_map.survey(dead, largest_tilt_deg=1), need_Nm=0.1)
    (warning,) = verdict.warnings
    assert warning.startswith("the torque matrix loses the direction (")
    assert warning.endswith("at 2 of 2 tilts")
    for row in verdict.by_tilt:
        assert row.condition == row.copper_W_per_Nm2 == np.inf
        assert row.best_Nm == row.least_norm_Nm == 0
    assert broken(verdict.checks) == ["need"]
    assert verdict.checks[-1].value == np.inf


def test_hinges_that_reach_no_pose_are_refused(actuator):
    nowhere = replace(actuator, hinge_range_rad=np.full((3, 2), 9.0))
    with pytest.raises(InputError, match="hinge ranges that hold some pose"):
        torque_map.survey(nowhere, largest_tilt_deg=0)
