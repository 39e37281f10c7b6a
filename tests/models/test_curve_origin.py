"""What a torque curve was computed for, held against the model that uses it."""

from dataclasses import fields, replace

import pytest

from spheretwin.models.curve_origin import disagreements
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet


@pytest.mark.parametrize(
    ("part", "name"),
    [
        (part, field.name)
        for part, kind in (("magnet", Magnet), ("coil", CoilGeometry))
        for field in fields(kind)
    ],
)
def test_every_number_of_magnet_and_coil_is_compared(actuator, part, name):
    data = getattr(actuator, part)
    changed = replace(actuator, **{part: replace(data, **{name: getattr(data, name) * (1 + 1e-8)})})
    (line,) = disagreements(changed)
    assert f"{part} {name} " in line
    # Less than any rounding of a sum or a rotation is no difference.
    changed = replace(actuator, **{part: replace(data, **{name: getattr(data, name) * (1 + 1e-11)})})
    assert disagreements(changed) == []


def test_each_number_has_a_line_of_its_own(actuator):
    coil = replace(actuator.coil, turns=1.0, length_m=0.03)
    assert len(disagreements(replace(actuator, coil=coil))) == 2


def test_a_curve_that_says_nothing_of_the_front_was_computed_for_flat_poles(actuator):
    said = {k: v for k, v in actuator.torque_curve.computed_for.items() if k != "magnet front_radius_m"}
    older = replace(actuator, torque_data=replace(actuator.torque_curve, computed_for=said))
    (line,) = disagreements(older)
    assert line.endswith("was computed for magnet front_radius_m 0, the model has 0.05")
    assert disagreements(replace(older, magnet=replace(actuator.magnet, front_radius_m=0.0))) == []


def test_a_curve_that_does_not_say_is_taken_as_it_is(actuator):
    curve = replace(actuator.torque_curve, computed_for=None)
    coil = replace(actuator.coil, turns=1.0)
    assert disagreements(replace(actuator, torque_data=curve, coil=coil)) == []


def test_a_file_s_name_cannot_break_the_line(actuator):
    curve = replace(actuator.torque_curve, name="torque curve a\x1b[2J\nb.csv")
    (line,) = disagreements(replace(actuator, torque_data=curve, coil=replace(actuator.coil, turns=1.0)))
    assert line.isprintable()
