"""The actuator read from its MJCF, and models that are none."""

import re
from pathlib import Path

import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.simulation import simulate

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
        ('range="-80 80"', 'range="-80 90"', "where the joint locks, received -80 to 90"),
        ('data="8"', 'data="inf"', "group_current_limit_A from 1e-09 to 1e+09, received inf"),
        ('data="8"', 'data="-8"', "received -8"),
        ('data="8"', 'data="1e12"', "group_current_limit_A from 1e-09 to 1e+09, received 1e+12"),
        ('data="8"', 'data="1000000001"', "from 1e-09 to 1000000000, received 1000000001"),
        ('data="8"', 'data="1e-300"', "received 1e-300"),
        ('data="1.3"', 'data="1e-300"', "group_resistance_ohm from"),
        ('data="1.3"', 'data="1e-8"', "_H / group_resistance_ohm of at most 1000 s, received 90000"),
        ('data="0.9e-3"', 'data="1301"', "of at most 1000 s, received 1000.77"),
        ('data="0.9e-3"', 'data="1300.0000013"', "of at most 1000 s, received 1000.000001"),
        ('data="0.9e-3"', 'data="0"', "group_inductance_H from"),
        ('data="1.2"', 'data="1e300"', "magnet_remanence_T from"),
        ('data="320"', 'data="1e-300"', "coil_turns from"),
        ('size="0.010 0.005"', 'size="1e-300 0.005"', "a radius of the poles in metres from 1e-06 to 1000"),
        ('size="0.010 0.005"', 'size="0.010 1e-12"', "a length of the poles in metres"),
        ('size="0.011 0.0125"', 'size="1e6 0.0125"', "a radius of the coils in metres from 1e-06 to 1000"),
        ('size="0.011 0.0125"', 'size="0.011 1e300"', "at most 1e+09, received 1e+300 in site_size"),
        ('pos="0.045 0 0"', 'pos="0 0 0"', "a distance of the poles in metres from 1e-06"),
        ('pos="0.063 0 0"', 'pos="1e300 0 0"', "in site_pos"),
        ('name="coil_middle" class="coil" pos="0.063', 'name="coil_middle" class="coil" pos="0.06300001',
         "one distance of the coils, received 0.063 to 0.06300001 m"),
        ('diaginertia="2.219e-3 2.176e-3 2.256e-3"', 'diaginertia="1e300 1e300 1e300"', "in body_inertia"),
        ('name="coil_turns" data="320"', 'name="coil_windings" data="320"', '"coil_turns"'),
        ('data="0.003"', 'data="0.012"', "below the coils' radius"),
        ('user="-1"', 'user="2"', "polarity 1 or -1"),
        ('user="-1"', 'user="-1.00000001"', "of pole_upper_south0, received -1.00000001"),
        ('name="shaft_tip"', 'name="tip"', '"shaft_tip"'),
        ('pos="0 0 0.12"', 'pos="0 0 nan"', "finite numbers"),
        ('<inertial pos="0 0 0" mass="1.6"', '<inertial pos="0 0 0.01" mass="1.6"', "centre of mass"),
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


def test_groups_are_as_many_as_the_file_has(tmp_path):
    (path := tmp_path / "mine.xml").write_text(TEXT.replace(RING + SITE, RING_OF_EIGHT + SITE))
    assert actuators.load(path).groups.shape == (16, 2)


def test_two_groups_cannot_give_three_torques(tmp_path):
    tilted = re.compile(r"(?s)<replicate count=.12. euler=.0 0 30.>\s*<frame.*?</replicate>")
    text = tilted.sub("", TEXT).replace(RING + SITE, '<replicate count="4" euler="0 0 90">' + SITE)
    (path := tmp_path / "mine.xml").write_text(text)
    with pytest.raises(InputError, match="at least 3 groups of two coils, received 2"):
        actuators.load(path)


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


@pytest.mark.parametrize("limit", ["1e-9", "1e9"])
@pytest.mark.parametrize(("resistance", "inductance"), [("1e-9", "1e-6"), ("1e9", "1e-9"), ("1e6", "1e9")])
def test_a_run_takes_every_drive_that_a_model_may_have(tmp_path, limit, resistance, inductance):
    text = TEXT.replace('data="8"', f'data="{limit}"').replace('data="1.3"', f'data="{resistance}"')
    (path := tmp_path / "mine.xml").write_text(text.replace('data="0.9e-3"', f'data="{inductance}"'))
    scenario = scenarios.load("hold", {"plant.mjcf": str(path), "duration": 0.003})
    assert simulate(scenario).status == "completed"


def test_a_path_that_no_file_can_have_is_told_in_one_line():
    with pytest.raises(InputError, match="expected an MJCF file") as caught:
        actuators.load(Path("x" * 20_000))
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("old", ['pos="0.045 0 0"', 'pos="0.063 0 0"'])
def test_a_model_without_bounds_yields_no_magnet_and_no_coil(tmp_path, old):
    (path := tmp_path / "mine.xml").write_text(TEXT.replace(old, 'pos="1e300 0 0"'))
    with pytest.raises(InputError, match="site_pos"):
        actuators.read_magnet_and_coil(path)


def test_files_that_have_not_changed_are_one_actuator(tmp_path):
    (path := tmp_path / "mine.xml").write_text(TEXT)
    (curve := tmp_path / "mine.csv").write_bytes(actuators.TORQUE_CURVE_PATH.read_bytes())
    first = actuators.load(path, curve)
    assert actuators.load(path, curve) is first
    curve.write_bytes(curve.read_bytes().replace(b"0.000762479810", b"0.000762479811"))
    assert actuators.load(path, curve) is not first
