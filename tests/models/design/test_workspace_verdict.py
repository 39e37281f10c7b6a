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


@pytest.mark.release("surveys the workspace for 1 s; content of design_workspaces has its values")
def test_torque_is_told_by_tilt(surveyed):
    verdict = torque_map.judge(surveyed)
    assert [row.tilt_deg for row in verdict.by_tilt] == list(range(13))
    # Measured by another program: 0.8745 upright, 0.5574 at 12 degrees.
    assert verdict.by_tilt[0].least_norm_Nm == pytest.approx(0.8745, rel=1e-3)
    assert verdict.by_tilt[-1].least_norm_Nm == pytest.approx(0.5574, rel=1e-3)
    resistance = surveyed.actuator.group.resistance_ohm
    for row in verdict.by_tilt:
        assert row.least_norm_Nm <= row.best_Nm
        assert row.least_norm_Nm <= row.least_norm_median_Nm
        assert row.best_Nm <= row.best_median_Nm
        assert row.copper_W_per_Nm2 == pytest.approx(resistance / row.singular_value_Nm_per_A**2)
    assert broken(verdict.checks) == verdict.warnings == []


@pytest.mark.release("surveys the workspace for 1 s; content of design_workspaces has its values")
def test_weakest_pose_is_the_worst_of_all_tilts(surveyed):
    verdict = torque_map.judge(surveyed)
    weakest = verdict.weakest[0]
    assert weakest.figure == "least_norm"
    assert weakest.least_norm_Nm == pytest.approx(min(row.least_norm_Nm for row in verdict.by_tilt))
    assert np.linalg.norm(weakest.direction) == pytest.approx(1)
    assert [pose.figure for pose in verdict.weakest] == sorted(
        (pose.figure for pose in verdict.weakest), key=list(torque_map.REPORTED_POSES).index
    )


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
