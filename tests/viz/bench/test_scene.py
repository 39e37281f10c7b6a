"""The actuator in few triangles: closed solids of the right size, and poses that are the rotor's."""

from math import prod

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from spheretwin.models.kinematics import rotation
from spheretwin.viz import theme
from spheretwin.viz.bench import scene as colours
from spheretwin.viz.bench import server as front
from spheretwin.viz.bench.access import Access
from spheretwin.viz.bench.actuator import actuator_solids, quaternions_along
from spheretwin.viz.bench.scene import Scene
from spheretwin.viz.scene import solids
from tests.viz.bench import fake

# Coordinates are single precision: 1e-7 of a length, and of a volume three times that.
SINGLE = 1e-6

# A browser without a GPU draws them 10 times a second and more.
MOST_TRIANGLES = 10_000


def is_closed(solid):
    """Whether each edge, by the places of its ends, is walked once in each direction."""
    mesh = trimesh.Trimesh(np.round(solid.positions.astype(float), 7), solid.triangles)
    mesh.update_faces(mesh.nondegenerate_faces())  # at the axis
    return mesh.is_watertight and mesh.is_winding_consistent


def volume(solid):
    """Enclosed volume; positive where the faces look outward."""
    return trimesh.Trimesh(solid.positions, solid.triangles, process=False).volume


def polygon(sections):
    """Area of a regular polygon within the unit circle."""
    return sections / 2 * np.sin(2 * np.pi / sections)


def as_the_page_shows(albedo):
    """Numbers on the screen, 0 to 255, of what a surface gives back: the curve, forward."""
    into = [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
    out_of = [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
    light = np.array(into) @ albedo * colours.LIGHT / 0.6
    pressed = (light * (light + 0.0245786) - 0.000090537) / (light * (0.983729 * light + 0.432951) + 0.238081)
    linear = np.clip(out_of @ pressed, 0.0, 1.0)
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize("current", np.linspace(-1.0, 1.0, 9))
def test_a_current_is_shown_in_its_own_colour(current):
    meant = theme.current_colours(np.array(current), 1.0)
    seen = as_the_page_shows(colours.instance_colours(meant) / 255)
    # No colour of a surface makes the curve's blue as deep as the screen's: 14.3 of 255; the others, to 4.
    assert seen == pytest.approx(meant, abs=15 if current == -1.0 else 4)


def test_one_solid_is_shown_in_its_own_colour():
    for meant in (theme.TRACE, (150, 156, 166), (70, 76, 86)):
        encoded = np.array(colours.mesh_colour(meant)) / 255
        albedo = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
        assert as_the_page_shows(albedo) == pytest.approx(meant, abs=11)  # the trace is nearly all light


def test_solids_have_the_volume_of_their_prisms():
    assert volume(solids.bar((1.0, 2.0, 3.0))) == pytest.approx(6.0, rel=SINGLE)
    assert volume(solids.cylinder(0.5, -1.0, 2.0, 7)) == pytest.approx(0.25 * 3 * polygon(7), rel=SINGLE)
    assert volume(solids.tube(1.0, 2.0, 0.0, 1.5, 16)) == pytest.approx(4.5 * polygon(16), rel=SINGLE)


@pytest.mark.parametrize("name", ["stator", "outer_ring", "inner_ring", "rotor", "shaft", "coil"])
def test_every_part_is_closed_and_looks_outward(actuator, name):
    part = getattr(actuator_solids(actuator), name)
    assert is_closed(part)
    assert volume(part) > 0


def test_all_of_it_is_few_triangles(actuator):
    assert actuator_solids(actuator).triangles(actuator) < MOST_TRIANGLES


def test_quaternions_turn_z_to_each_axis(actuator):
    axes = np.concatenate([actuator.coil_axes, np.eye(3), -np.eye(3)])
    turned = Rotation.from_quat(quaternions_along(axes), scalar_first=True).apply([0, 0, 1])
    assert turned == pytest.approx(axes, abs=1e-12)  # rounding


@pytest.fixture
def scene(actuator):
    listening = front.listen(0)
    server = front.serve(listening, "scene", Access(listening.getsockname()[1]), lambda *_: None)
    yield Scene(server.scene, actuator)
    front.stop(server)


def test_the_tip_that_is_drawn_is_the_rotors(scene, actuator):
    for q in ([0.3, -0.2, 1.0], [-1.2, 0.9, -3.0]):
        scene.move(np.zeros(3), np.array(q), np.zeros(len(actuator.groups)), 8.0)
        tip = rotation(np.array(q)) @ actuator.shaft_tip_m
        assert scene.handle.position == pytest.approx(tip, abs=1e-12)  # rounding


def test_each_hinge_turns_about_its_own_axis(scene, actuator):
    """Frames within frames: the product of their turns is the rotor's orientation."""
    q = np.array([0.3, -0.2, 1.0])
    scene.move(q, None, np.zeros(len(actuator.groups)), 8.0)
    turns = (Rotation.from_quat(hinge.wxyz, scalar_first=True) for hinge in scene._hinges)
    assert prod(turns, start=Rotation.identity()).as_matrix() == pytest.approx(rotation(q), abs=1e-12)
    assert not scene.handle.visible


def test_the_tip_goes_under_the_pointer(scene, actuator):
    """The inverse of the tip's place, from any eye that sees it."""
    for q in ([0.3, 0.2, 0.5], [-0.4, 0.6, -1.0], [0.0, 0.0, 0.0]):
        tip = rotation(np.array(q)) @ actuator.shaft_tip_m
        eye = 2.5 * tip + [0.02, -0.05, 0.01]
        for depth in (0.5, 1.0, 3.0):
            pose = scene.pose_under(tuple(eye + depth * (tip - eye)), eye, q[2])
            assert pose == pytest.approx(q, abs=1e-9)  # of a square root that cancels


def test_a_pointer_beside_the_sphere_gives_a_pose_all_the_same(scene):
    eye = np.array([0.0, -0.4, 0.1])
    for point in ((0.4, 0.0, 0.1), (0.0, -0.4, 0.1), (0.0, 0.0, 5.0)):
        assert np.isfinite(scene.pose_under(point, eye, 0.0)).all()


def test_both_coils_of_a_group_have_its_colour(scene, actuator):
    current = np.zeros(len(actuator.groups))
    current[5] = 8.0
    scene.move(np.zeros(3), None, current, 8.0)
    colours = np.array(scene.coils.batched_colors)
    (red,) = np.unique(colours[actuator.groups[5]], axis=0)
    assert (colours == red).all(axis=1).sum() == 2


def test_the_path_of_the_tip_is_that_of_the_rows_and_restarts_with_a_run(scene, actuator):
    """Chunks of any size give the same path: its points are rows of the run, not frames of the page."""
    bench = fake.Bench()
    scene.trail(bench.bins(scene.trail_after))
    for count in (10, 11, 37, 50):
        bins = bench.bins(scene.trail_after)
        new = {name: values[: max(0, count - 1 - scene.trail_after)] for name, values in bins.rows.items()}
        scene.trail(bins._replace(numbers=bins.numbers[: len(new["q_rad"])], rows=new))
    tips = np.array([rotation(q) @ actuator.shaft_tip_m for q in bench.bins().rows["q_rad"]])
    drawn = np.array(scene._line.points)
    assert drawn[:, 0] == pytest.approx(tips[:-1], abs=1e-7)  # single precision, of tenths of a metre
    assert drawn[:, 1] == pytest.approx(tips[1:], abs=1e-7)
    bench.run = 2
    scene.trail(bench.bins(scene.trail_after))
    assert (np.array(scene._line.points) == 0.0).all()
    scene.trail(bench.bins(scene.trail_after))
    assert len(scene._line.points) == len(tips) - 1
