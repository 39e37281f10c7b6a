"""Poses of the drawn bodies against the kinematics; meshes as the model file places them."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from spheretwin.models import actuator as actuators
from spheretwin.models.kinematics import rotation
from spheretwin.viz import theme
from spheretwin.viz.scene.entities import body_quaternions, coil_texture, current_scale, size_of
from spheretwin.viz.scene.meshes import SECTIONS, WORLD, read_meshes
from spheretwin.viz.scene.places import shaft_tip
from tests.models.model_files import edited

poses = st.tuples(*[st.floats(-1.4, 1.4)] * 2, st.floats(-40, 40)).map(lambda q: np.array([q]))


@given(poses)
def test_bodies_turn_hinge_by_hinge(q):
    quaternions = body_quaternions(q)
    alone = {"outer_ring": [1, 0, 0], "inner_ring": [1, 1, 0], "rotor": [1, 1, 1]}
    for body, hinges in alone.items():
        matrix = Rotation.from_quat(quaternions[body][0]).as_matrix()
        np.testing.assert_allclose(matrix, rotation(q[0] * hinges), atol=1e-14)


SITE = '<site name="shaft_tip" class="marker" pos="0 0 0.12"/>'
OFF_AXIS = '<site name="shaft_tip" class="marker" pos="0.021 -0.013 0.11"/>'


@pytest.fixture(scope="module")
def off_axis(tmp_path_factory):
    """A model whose shaft ends beside the γ axis, as the engine has it and as an actuator."""
    path = edited(tmp_path_factory.mktemp("model"), (SITE, OFF_AXIS))
    model = mujoco.MjModel.from_xml_path(str(path))
    return model, mujoco.MjData(model), actuators.load(path)


@given(q=poses)
def test_a_tip_off_the_spin_axis_is_drawn_where_the_engine_has_it(off_axis, q):
    model, data, bent = off_axis
    data.qpos[:] = q[0]
    mujoco.mj_kinematics(model, data)
    # Three rotations of a tenth of a metre, each rounded once or twice.
    np.testing.assert_allclose(shaft_tip(q, bent)[0], data.site("shaft_tip").xpos, atol=4e-16)


def positions(drawn):
    """Vertices of a mesh or places of points, (n, 3) in m."""
    batch = drawn.vertex_positions if hasattr(drawn, "vertex_positions") else drawn.positions
    return np.array(batch.as_arrow_array().to_pylist())


def placed(piece):
    """Vertices of each copy of a piece in the frame of what carries it: (copies, n, 3) in m."""
    return np.einsum("cij,nj->cni", piece.rotations, piece.positions) + piece.translations[:, None]


UPPER, LOWER, MIDDLE = (
    f'<geom name="coil_{layer}" class="coil" pos="0.063 0 0" zaxis="1 0 0"/>'
    for layer in ("upper", "lower", "middle")
)


@pytest.mark.parametrize(
    "edits",
    [
        [],
        # The drawn upper layer stands where the lower one's sites are, and the other way round.
        [
            (UPPER, f'<frame euler="0 56 0">{UPPER}</frame>'),
            (LOWER, f'<frame euler="0 -56 0">{LOWER}</frame>'),
        ],
        [(MIDDLE, "")],
        [(MIDDLE, MIDDLE + MIDDLE.replace("coil_middle", "coil_middle_again"))],
    ],
    ids=["shipped", "in another order", "not all", "some twice"],
)
def test_each_drawn_coil_looks_up_the_pixel_of_its_group(tmp_path, edits):
    path = edited(tmp_path, *edits)
    model, meshes = actuators.load(path), read_meshes(path)
    texture = coil_texture(meshes, model)
    vertices = positions(meshes.coils)
    across = np.array(texture.vertex_texcoords.as_arrow_array().to_pylist())[:, 0]
    text = path.read_text(encoding="utf-8")
    shipped = positions(read_meshes(actuators.MJCF_PATH).coils)
    assert 36 * len(vertices) == 12 * text.count('<geom name="coil_') * len(shipped)  # none is left out
    centres = vertices.reshape(-1, len(shipped) // 36, 3).mean(axis=1)  # symmetric about the coil's axis
    coils = np.argmax(centres @ model.coil_axes.T, axis=1)
    groups = [int(np.flatnonzero((model.groups == coil).any(axis=1))[0]) for coil in coils]
    shares = across.reshape(len(centres), -1)
    pixels = (np.array(groups)[:, None] + 0.5) / len(model.groups)
    np.testing.assert_allclose(shares, np.broadcast_to(pixels, shares.shape), rtol=1e-6)
    drawn = 12 * sum(layer in text for layer in (UPPER, MIDDLE, LOWER))
    assert len(set(coils.tolist())) == drawn


def test_coils_stand_where_the_model_puts_them_and_fill_their_numbers(actuator):
    coils = positions(read_meshes(actuators.MJCF_PATH).coils).reshape(36, -1, 3)
    centres = coils.mean(axis=1)
    # Each coil's vertices are symmetric about its axis and its middle, to single precision.
    np.testing.assert_allclose(centres, actuator.coil.distance_m * actuator.coil_axes, atol=1e-7)
    height = np.einsum("cvi,ci->cv", coils, actuator.coil_axes) - actuator.coil.distance_m
    distance = np.linalg.norm(np.cross(coils, actuator.coil_axes[:, None]), axis=2)
    for result, ends in (
        (height, (-actuator.coil.length_m / 2, actuator.coil.length_m / 2)),
        (distance, (actuator.coil.inner_radius_m, actuator.coil.outer_radius_m)),
    ):
        np.testing.assert_allclose(np.sort(result, axis=1)[:, [0, -1]], np.tile(ends, (36, 1)), atol=1e-7)


def test_faces_and_normals_of_a_coil_point_outward(actuator):
    mesh = read_meshes(actuators.MJCF_PATH).coils
    corners = positions(mesh)[np.array(mesh.triangle_indices.as_arrow_array().to_pylist())]
    normals = np.array(mesh.vertex_normals.as_arrow_array().to_pylist())
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ahead = normals[np.array(mesh.triangle_indices.as_arrow_array().to_pylist())]
    # Of a circle of so many facets one is half of its angle off the normals at its corners.
    cosines = np.einsum("ti,tki->tk", facing, ahead) / np.linalg.norm(facing, axis=1, keepdims=True)
    assert cosines.min() > np.cos(np.pi / SECTIONS + np.radians(0.1))
    # A closed surface that faces outward holds its volume; a circle of fourteen lacks 3.3 % of its area.
    volume = np.einsum("ti,ti->t", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6 / 36
    coil = actuator.coil
    hull = np.pi * (coil.outer_radius_m**2 - coil.inner_radius_m**2) * coil.length_m
    assert 0.75 * hull < volume < hull


def test_all_poles_are_drawn_in_the_grey_of_their_polarity(actuator):
    pieces = read_meshes(actuators.MJCF_PATH).others
    for polarity, name, grey in ((1, "north", theme.NORTH), (-1, "south", theme.SOUTH)):
        piece = pieces[f"{WORLD}/rotor/poles_{name}"]
        axes = actuator.pole_axes[actuator.pole_polarity == polarity]
        directions = placed(piece).mean(axis=1)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        # Each direction is one axis of this polarity, and each axis has its pole.
        match = directions @ axes.T > 1 - 1e-6
        np.testing.assert_array_equal(match.sum(axis=0), 1)
        np.testing.assert_array_equal(match.sum(axis=1), 1)
        assert piece.colour == grey
    for red, green, blue in (theme.NORTH, theme.SOUTH):
        assert max(red, green, blue) - min(red, green, blue) < 16  # no hue: red and blue are currents
    assert min(theme.NORTH) > 2.5 * max(theme.SOUTH)  # and told apart by lightness alone


def world_positions(model, data, geom):
    """Vertices of a geom's mesh where the engine has them, in the stator frame."""
    first, count = model.mesh_vertadr[model.geom_dataid[geom]], model.mesh_vertnum[model.geom_dataid[geom]]
    turned = model.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T
    return turned + data.geom_xpos[geom]


def spanned(points):
    """Corners of the box that holds some points."""
    return np.array([points.min(axis=0), points.max(axis=0)])


def test_every_mesh_is_named_and_stands_where_the_engine_has_it():
    model = mujoco.MjModel.from_xml_path(str(actuators.MJCF_PATH))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    pieces = read_meshes(actuators.MJCF_PATH).others
    names = ["stator/frame", "outer_ring/frame", "inner_ring/frame"]
    names += [f"rotor/{part}" for part in ("ball", "hoop", "shaft", "poles_north", "poles_south")]
    assert list(pieces) == [f"{WORLD}/{name}" for name in names]
    for geom in range(model.ngeom):
        body, name = model.body(model.geom_bodyid[geom]).name, model.geom(geom).name
        if name.startswith(("pole", "coil")) or model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
            continue
        piece = pieces[f"{WORLD}/{body}/{'frame' if name == body else name}"]
        np.testing.assert_allclose(
            spanned(placed(piece)[0]), spanned(world_positions(model, data, geom)), atol=1e-7
        )


TOOL = """
<body name="tool" pos="0 0 0.11" euler="90 0 0">
  <geom type="mesh" mesh="shaft"/>
  <geom type="mesh" mesh="shaft" rgba="0 1 0 1"/>
  <geom type="mesh" mesh="shaft" rgba="0 1 0 1" pos="0.02 0 0"/>
  <inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/>
</body>
"""


def test_meshes_without_names_have_those_of_their_files_and_move_with_what_carries_them(tmp_path):
    path = edited(tmp_path, (SITE, SITE + TOOL))
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    pieces = read_meshes(path).others
    alone, pair = (pieces[f"{WORLD}/rotor/tool/{name}"] for name in ("shaft", "shaft_2"))
    mine = [i for i in range(model.ngeom) if model.body(model.geom_bodyid[i]).name == "tool"]
    drawn = [*placed(alone), *placed(pair)]
    assert len(drawn) == len(mine) == 3
    for geom, points in zip(mine, drawn, strict=True):
        expected = world_positions(model, data, geom)
        np.testing.assert_allclose(spanned(points), spanned(expected), atol=1e-7)


def test_marks_grow_with_the_actuator_that_they_stand_beside(actuator):
    assert size_of(actuator) == pytest.approx(1.0, rel=1e-15)  # the lengths are those for the shipped one
    larger = replace(actuator, shaft_tip_m=3 * actuator.shaft_tip_m)
    assert size_of(larger) == pytest.approx(3.0, rel=1e-15)
    stub = replace(actuator, shaft_tip_m=0 * actuator.shaft_tip_m)  # the coils reach farther than its shaft
    assert size_of(stub) == pytest.approx((0.063 + 0.025 / 2) / 0.12, rel=1e-12)
    # Single precision.
    np.testing.assert_allclose(positions(current_scale(3.0)), 3 * positions(current_scale(1.0)), atol=1e-7)


def height(mjcf):
    """Largest coordinate of all that is drawn but the coils, m."""
    return max(np.max(placed(piece)) for piece in read_meshes(mjcf).others.values())


def test_an_edited_mesh_is_read_again(tmp_path):
    shutil.copytree(actuators.FOLDER / "assets", tmp_path / "assets")
    mjcf = Path(shutil.copy(actuators.MJCF_PATH, tmp_path / "mine.xml"))
    mesh = tmp_path / "assets" / "shaft.obj"
    before = height(mjcf)
    assert height(mjcf) == before
    vertex = re.compile(r"^(v \S+ \S+) (\S+)", re.MULTILINE)
    mesh.write_text(vertex.sub(lambda found: f"{found[1]} {float(found[2]) + 1.0}", mesh.read_text()))
    # A metre up; the file's digits are cut to single precision.
    np.testing.assert_allclose(height(mjcf), before + 1.0, atol=1e-6)
