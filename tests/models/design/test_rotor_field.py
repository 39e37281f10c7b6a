"""Torque field of magnets: a dipole exactly, boxes against forces, images, the shipped poles, refusals."""

import re

import mujoco
import numpy as np
import pytest

from spheretwin import cli
from spheretwin.models import actuator as actuators
from spheretwin.models import magnet_and_coil, torque_field
from spheretwin.models.design import rotor_field
from spheretwin.models.torque_field import TorqueField, directions
from tests.models import poses
from tests.models.design.quadrature import winding_section

SECOND = poses.SECOND.read_text()
POLES = re.compile(
    r"(?s)            <frame euler=\"0 0 0\">\n              <frame euler=\"0 -46.4.*"
    r"(?=            <site name=\"shaft_tip)"
)
POLE = '<site name="pole_{}" class="north" {}/>\n'


def written(tmp_path, *poles):
    """The second actuator's coils, with other magnets."""
    assert POLES.search(SECOND)
    sites = "".join(POLE.format(number, pole) for number, pole in enumerate(poles))
    (path := tmp_path / "mine.xml").write_text(POLES.sub(sites, SECOND))
    return path


def test_a_sphere_at_the_centre_is_a_dipole(tmp_path):
    radius = 0.02
    path = written(tmp_path, f'type="sphere" size="{radius}" pos="0 0 0"')
    computed = rotor_field.compute(path, 6.0, 6)
    coil = magnet_and_coil.read_coil(mujoco.MjModel.from_xml_path(str(path)))
    moment = 1.2 / (4e-7 * np.pi) * 4 / 3 * np.pi * radius**3
    rho, z, share = np.transpose(winding_section(coil, 40, 40))
    # A turn of radius rho at height z links µ0 m rho² / 2 r³ of a dipole along its axis.
    linked = coil.turns * share @ (4e-7 * np.pi * moment * rho**2 / (2 * np.hypot(rho, z) ** 3))
    axes = directions(31, 60)
    expected = -linked * np.cross(axes, [0.0, 0.0, 1.0])  # -n x grad(linked n.z)
    np.testing.assert_allclose(computed.field.torque_Nm_per_A, expected, rtol=0, atol=1e-9 * linked)


def test_magnets_of_any_shape_and_pose_agree_with_their_forces(tmp_path):
    path = written(
        tmp_path,
        'type="box" size="0.006 0.004 0.003" pos="0.015 0.004 -0.003" euler="20 50 10"',
        'type="sphere" size="0.005" pos="-0.012 0.005 0.01" euler="70 0 30"',
        'type="cylinder" size="0.006 0.004" pos="0 -0.016 0.004" euler="80 10 0"',
    )
    (check,) = rotor_field.compute(path, 3.0, 60).checks
    assert 0 < check.value < check.bound == 1e-3


def test_the_mirror_image_makes_each_magnet_twice_as_long(tmp_path):
    half = written(tmp_path, 'size="0.006 0.004" pos="0.02 0 0" zaxis="1 0 0"')
    imaged = rotor_field.compute(half, 6.0, 40, on_iron=True)
    double = written(tmp_path, 'size="0.006 0.008" pos="0.016 0 0" zaxis="1 0 0"')
    expected = rotor_field.compute(double, 6.0, 40).field
    difference = imaged.field.torque_Nm_per_A - expected.torque_Nm_per_A
    assert np.abs(difference).max() < 1e-9 * expected.peak_Nm_per_A  # the same field, summed otherwise


@pytest.mark.release("field of all poles for 6 s; a sphere and a box are compared in less")
def test_the_shipped_poles_have_the_torque_of_their_curve(actuator):
    field = rotor_field.compute(actuators.MJCF_PATH, 6.0, 90).field
    axes = directions(31, 60)
    expected = np.zeros_like(axes)
    for r, polarity in zip(actuator.pole_axes, actuator.pole_polarity, strict=True):
        expected += polarity * actuator.torque_curve.over_sine(axes @ r)[..., None] * np.cross(r, axes)
    error = np.abs(field.torque_Nm_per_A - expected).max()
    # The stack of 24 cylinders that stands for a ground pole is within 2e-4; degrees above 90 give the rest.
    assert error < 1e-3 * actuator.torque_curve.peak_Nm_per_A


def test_what_the_verb_writes_is_read_back_and_runs(tmp_path, capsys):
    path = written(tmp_path, 'size="0.006 0.004" pos="0.02 0 0" zaxis="1 0 0"')
    out = tmp_path / "torque_field.csv"
    flags = ["--mjcf", str(path), "--degree", "40", "--step", "3"]
    assert cli.main(["magnetics", "field", *flags, "--out", str(out)]) == 0
    field = torque_field.read(out)
    assert isinstance(field, TorqueField)
    assert field.computed_for["coil turns"] == 400
    assert actuators.load(path).torque_data.peak_Nm_per_A == field.peak_Nm_per_A
    assert "Remake: spheretwin magnetics field --step 3 --degree 40\n" in out.read_text()
    capsys.readouterr()
    assert cli.main(["magnetics", "field", *flags]) == 0
    assert capsys.readouterr().out == out.read_text()


@pytest.mark.parametrize("flags", [["--step", "7"], ["--step", "0"], ["--degree", "2"], ["--degree", "x"]])
def test_bad_flags_are_refused(flags, capsys):
    assert cli.main(["magnetics", "field", *flags]) == 2
    error = capsys.readouterr().err
    assert error.startswith("spheretwin: command line: argument")
    assert error.count("\n") == 1
