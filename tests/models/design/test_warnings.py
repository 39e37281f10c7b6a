"""What a user is told of a geometry, and of a curve beside the geometry it was computed for."""

from dataclasses import replace

from spheretwin.models import actuator as actuators
from spheretwin.models.design import geometry_check


def test_a_model_file_is_held_against_a_curve_that_says_what_it_is_for(actuator, tmp_path):
    text = actuators.MJCF_PATH.read_text(encoding="utf-8")
    (path := tmp_path / "mine.xml").write_text(text.replace('_turns" data="320"', '_turns" data="640"'))
    (line,) = geometry_check.of_model_file(path, actuator.torque_curve)
    assert "coil turns 320" in line
    # As one that has just been computed from the file itself.
    assert geometry_check.of_model_file(path, replace(actuator.torque_curve, computed_for=None)) == []


def test_a_model_file_without_a_rotor_is_not_warned_of(actuator, tmp_path):
    (path := tmp_path / "mine.xml").write_text("<mujoco/>")
    assert geometry_check.of_model_file(path, actuator.torque_curve) == []
