"""Shapes of poles and coils: the torque curve is of cylinders, every other shape is refused by name."""

import numpy as np
import pytest

from spheretwin import cli
from spheretwin.models import actuator as actuators
from spheretwin.models import magnet_and_coil
from spheretwin.models.base.errors import InputError
from spheretwin.models.kinematics import frame_of_axis
from spheretwin.scenario import load
from spheretwin.scenario.files import files_of
from tests.models.model_files import edited

SHAPES = {
    "box": 'type="box" size="0.009 0.009 0.005"',
    "sphere": 'type="sphere" size="0.005"',
    "ellipsoid": 'type="ellipsoid" size="0.009 0.009 0.005"',
    "capsule": 'type="capsule" size="0.005 0.005"',
}
POLE, COIL = 'type="cylinder" size="0.010 0.005"', 'type="cylinder" size="0.011 0.0125"'


def model_file(folder, part, shape):
    """Write the shipped model with the sites of poles or of coils in another shape."""
    flat = ('<numeric name="pole_front_radius_m" data="0.05"/>', "")
    return edited(folder, flat, (f"<site {part}", f"<site {SHAPES[shape]}"))


@pytest.mark.parametrize("shape", SHAPES)
def test_a_curve_is_refused_for_other_shapes(tmp_path, capsys, shape):
    path = model_file(tmp_path, POLE, shape)
    for read in (magnet_and_coil.read_magnet_and_coil, actuators.load):
        with pytest.raises(InputError, match=f"as a cylinder, received the shape {shape}.*magnetics field"):
            read(path)
    with pytest.raises(InputError, match=f"pole_.* received the shape {shape}"):
        files_of(load("hold", {"plant.mjcf": str(path)}))
    for part in ("curve", "check"):
        assert cli.main(["magnetics", part, "--mjcf", str(path)]) == 2
    assert capsys.readouterr().err.count(f"received the shape {shape}") == 2


@pytest.mark.parametrize(
    ("shape", "radius_m", "length_m"),
    [
        ("box", 0.009 * 2**0.5, 0.01),
        ("sphere", 0.005, 0.01),
        ("ellipsoid", 0.009, 0.01),
        ("capsule", 0.005, 0.02),
    ],
)
def test_with_a_torque_field_a_pole_is_drawn_as_the_cylinder_around_it(tmp_path, shape, radius_m, length_m):
    model = actuators.read(model_file(tmp_path, POLE, shape)).described
    magnet = magnet_and_coil.read_magnet(model, magnet_and_coil.sites(model, "pole_"))
    assert (magnet.radius_m, magnet.length_m) == pytest.approx((radius_m, length_m), rel=1e-12)


def test_errors_of_placement_are_to_the_east_and_to_the_north(actuator):
    """The frames do not depend on rounding: an axis next to another has a frame next to it."""
    for axis in [*actuator.coil_axes, *actuator.pole_axes]:
        east, north, up = frame_of_axis(axis).T
        assert abs(east[2]) < 1e-15
        assert north[2] > 0
        assert up == pytest.approx(axis, abs=1e-15)
        assert east == pytest.approx([-axis[1], axis[0], 0] / (axis[0] ** 2 + axis[1] ** 2) ** 0.5, abs=1e-15)
        for component in range(3):
            moved = axis.copy()
            moved[component] += 1e-12
            near = frame_of_axis(moved / (moved @ moved) ** 0.5)
            assert near == pytest.approx(frame_of_axis(axis), abs=1e-11)


@pytest.mark.parametrize(
    ("axis", "east"), [((0, 0, 1), (0, 1, 0)), ((0, 0, -1), (0, 1, 0)), ((1e-16, 0, 1), (0, 1, 0))]
)
def test_an_axis_along_z_has_y_as_its_east(axis, east):
    assert tuple(frame_of_axis(np.array(axis, float))[:, 0]) == east
