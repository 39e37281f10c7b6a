"""The actuator read from its MJCF, and models that are none."""

import re

import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models.errors import InputError

TEXT = actuators.MJCF_PATH.read_text()
GAMMA = '<joint name="gamma" axis="0 0 1"/>'
SITE = "\n        <site"
RING = '<replicate count="12" euler="0 0 30">'
RING_OF_EIGHT = '<replicate count="8" euler="0 0 45">'


def test_counts_axes_and_polarity_are_the_paper_s(actuator):
    assert actuator.pole_axes.shape == (16, 3)
    assert actuator.coil_axes.shape == (36, 3)
    assert actuator.groups.shape == (18, 2)
    np.testing.assert_array_equal(actuator.inertia, [2.219e-3, 2.176e-3, 2.256e-3])
    for axes in (actuator.pole_axes, actuator.coil_axes):
        np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1, atol=1e-14)
    azimuth = np.round(np.degrees(np.arctan2(actuator.pole_axes[:, 1], actuator.pole_axes[:, 0])) / 45)
    np.testing.assert_array_equal(actuator.pole_polarity, np.where(azimuth % 2 == 0, 1, -1))


def test_groups_pair_opposite_coils(actuator):
    a, b = actuator.coil_axes[actuator.groups.T]
    np.testing.assert_allclose(a, -b, atol=1e-14)
    assert sorted(actuator.groups.ravel()) == list(range(36))


def test_arrays_are_frozen(actuator):
    with pytest.raises(ValueError, match="read-only"):
        actuator.inertia[0] = 1.0


def test_shipped_actuator_is_read_once():
    assert actuators.load() is actuators.load()


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ('axis="0 1 0"', 'axis="0 0 1"', "hinge beta about y"),
        (GAMMA, GAMMA.replace("/>", ' type="slide"/>'), "hinge gamma about z"),
        (GAMMA, "", "expected valid MJCF"),
        ('range="-80 80"', 'range="-170 170"', "range of beta"),
        ('data="8"', 'data="inf"', "group_current_limit_A finite"),
        ('data="8"', 'data="-8"', "above zero"),
        ('name="coil_turns" data="320"', 'name="coil_windings" data="320"', '"coil_turns"'),
        ('data="0.003"', 'data="0.012"', "below the coils' radius"),
        ('user="-1"', 'user="2"', "polarity 1 or -1"),
        ('name="shaft_tip"', 'name="tip"', '"shaft_tip"'),
        ('pos="0 0 0.12"', 'pos="0 0 nan"', "finite numbers"),
        ('<inertial pos="0 0 0" mass="1.6"', '<inertial pos="0 0 0.01" mass="1.6"', "centre of mass"),
        (RING + SITE, RING_OF_EIGHT + SITE, "18 groups of two coils, received 16"),
        ('<frame euler="0 28 0">', '<frame euler="0 29 0">', "one coil opposite coil_upper00"),
    ],
)  # fmt: skip
def test_a_model_that_is_no_such_actuator_is_told_in_one_line(tmp_path, old, new, part):
    assert old in TEXT
    meshes = f'meshdir="{actuators.FOLDER / "assets"}"'
    (path := tmp_path / "mine.xml").write_text(TEXT.replace(old, new).replace('meshdir="assets"', meshes))
    with pytest.raises(InputError, match=re.escape(part)) as caught:
        actuators.load(path)
    assert "\n" not in str(caught.value)


def test_an_edited_file_is_read_again(tmp_path):
    (path := tmp_path / "mine.xml").write_text(TEXT)
    assert actuators.load(path).group.current_limit_A == 8
    path.write_text(TEXT.replace('data="8"', 'data="6"'))
    assert actuators.load(path).group.current_limit_A == 6


def test_mujoco_leaves_no_log_behind(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (path := tmp_path / "mine.xml").write_text(TEXT.replace('mass="1.6"', 'mass="nan"'))
    with pytest.raises(InputError):
        actuators.load(path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["mine.xml"]
    assert capfd.readouterr().err == ""
