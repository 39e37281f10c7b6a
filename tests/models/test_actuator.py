"""The actuator read from its MJCF, and models that are none."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.simulation import simulate
from tests.models.model_files import edited

TEXT = actuators.MJCF_PATH.read_text()
FRONT = '<numeric name="pole_front_radius_m" data="0.05"/>'
SITE = "\n        <site"
RING = '<replicate count="12" euler="0 0 30">'


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


def test_groups_are_as_many_as_the_file_has_and_at_least_three(tmp_path):
    path = edited(tmp_path, (RING + SITE, '<replicate count="8" euler="0 0 45">' + SITE))
    assert actuators.load(path).groups.shape == (16, 2)
    tilted = re.findall(r"(?s)<replicate count=.12. euler=.0 0 30.>\s*<frame.*?</replicate>", TEXT)
    few = [(layer, "") for layer in tilted]
    path = edited(tmp_path, *few, (RING + SITE, '<replicate count="4" euler="0 0 90">' + SITE))
    with pytest.raises(InputError, match="at least 3 groups of coils, received 2"):
        actuators.load(path)


@pytest.mark.parametrize("front", ["", FRONT.replace("0.05", "0")])
def test_poles_are_flat_unless_the_model_says_how_they_are_ground(tmp_path, front):
    magnet = actuators.load(edited(tmp_path, (FRONT, front))).magnet
    assert magnet.front_radius_m == 0.0
    assert magnet.sagitta_m == 0.0
    assert magnet.volume_m3 == pytest.approx(np.pi * 0.010**2 * 0.010, rel=1e-12)


def test_the_shipped_poles_are_ground_to_the_ball(actuator):
    magnet = actuator.magnet
    assert magnet.front_m == pytest.approx(0.050, rel=1e-12)
    assert magnet.back_m == pytest.approx(0.040, rel=1e-12)
    # Sphere of 50 mm about the joint centre: the rim of a front of radius 10 mm lies on it.
    assert magnet.rim_m == pytest.approx(np.sqrt(0.050**2 - 0.010**2), rel=1e-12)
    assert magnet.reach_m == pytest.approx(0.050, rel=1e-12)
    # A flat front reaches farther, as its rim stands out of that sphere.
    assert replace(magnet, front_radius_m=0.0).reach_m == pytest.approx(np.hypot(0.050, 0.010), rel=1e-12)


@pytest.mark.parametrize("front_radius_m", [0.0101, 0.03, 0.05, 0.2])
def test_the_volume_of_a_ground_pole_is_the_sum_of_its_discs(actuator, front_radius_m):
    magnet = replace(actuator.magnet, front_radius_m=front_radius_m)
    rho = magnet.radius_m * (np.arange(20_000) + 0.5) / 20_000
    depth = front_radius_m - np.sqrt(front_radius_m**2 - rho**2)
    np.testing.assert_allclose([magnet.sagitta_at_m(r) for r in rho[::997]], depth[::997], rtol=0, atol=1e-15)
    shells = np.sum((magnet.length_m - depth) * 2 * np.pi * rho) * magnet.radius_m / 20_000
    # The midpoint rule's error falls with the square of 20,000 steps; steepest at the rim of a hemisphere.
    assert magnet.volume_m3 == pytest.approx(shells, rel=1e-6)


@pytest.mark.parametrize("ring", ["outer_ring", "inner_ring"])
def test_in_a_medium_a_ring_is_a_box_no_wider_than_it_is_drawn(ring):
    scene = mujoco.MjModel.from_xml_path(str(actuators.MJCF_PATH))
    body, mesh = scene.body(ring).id, scene.mesh(ring)
    I_x, I_y, I_z = scene.body_inertia[body]
    # The engine's equivalent box: edges along the principal axes, of the body's mass and inertia.
    edge = np.sqrt(6 * (I_y + I_z - I_x) / scene.body_mass[body])
    drawn = scene.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
    # Across the ring itself: its pins stand out further on one axis.
    across = np.sort(np.ptp(drawn, axis=0))[1]
    assert 0.95 * across < edge < across
    assert max(I_x, I_y, I_z) < 1e-12 * scene.body_inertia[scene.body("rotor").id].min()


def test_mujoco_leaves_no_log_behind(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError):
        actuators.load(edited(tmp_path, ('mass="1.6"', 'mass="nan"')))
    assert [entry.name for entry in tmp_path.iterdir()] == ["mine.xml"]
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("limit", ["1e-9", "1e9"])
@pytest.mark.parametrize(("resistance", "inductance"), [("1e-9", "1e-6"), ("1e9", "1e-9"), ("1e6", "1e9")])
def test_a_run_takes_every_drive_that_a_model_may_have(tmp_path, limit, resistance, inductance):
    drive = {"8": limit, "1.3": resistance, "0.9e-3": inductance}
    path = edited(tmp_path, *((f'data="{old}"', f'data="{new}"') for old, new in drive.items()))
    scenario = scenarios.load("hold", {"plant.mjcf": str(path), "duration": 0.003})
    assert simulate(scenario).status == "completed"


def test_files_that_have_not_changed_are_one_actuator(tmp_path):
    path = edited(tmp_path)
    (curve := tmp_path / "mine.csv").write_bytes(actuators.TORQUE_CURVE_PATH.read_bytes())
    first = actuators.load(path, curve)
    assert actuators.load(path, curve) is first
    curve.write_bytes(curve.read_bytes().replace(b"0.000746190511", b"0.000746190512"))
    assert actuators.load(path, curve) is not first
