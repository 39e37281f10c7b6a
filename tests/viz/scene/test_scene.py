"""Poses of the drawn bodies against the kinematics; meshes as the model file places them."""

import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from spheretwin.models import actuator as actuators
from spheretwin.models.kinematics import rotation
from spheretwin.viz import palette
from spheretwin.viz.scene.meshes import read_meshes
from spheretwin.viz.scene.paths import COILS, WORLD
from spheretwin.viz.scene.poses import body_quaternions, shaft_tip

poses = st.tuples(*[st.floats(-1.4, 1.4)] * 2, st.floats(-40, 40)).map(lambda q: np.array([q]))


@given(poses)
def test_bodies_turn_hinge_by_hinge(q):
    quaternions = body_quaternions(q)
    alone = {"outer_ring": [1, 0, 0], "inner_ring": [1, 1, 0], "rotor": [1, 1, 1]}
    for body, hinges in alone.items():
        matrix = Rotation.from_quat(quaternions[body][0]).as_matrix()
        np.testing.assert_allclose(matrix, rotation(q[0] * hinges), atol=1e-14)


@given(q=poses)
def test_shaft_tip_is_the_model_s(actuator, q):
    expected = rotation(q[0]) @ actuator.shaft_tip_m
    np.testing.assert_allclose(shaft_tip(q, actuator)[0], expected, atol=1e-15)


OFF_AXIS = '<site name="shaft_tip" class="marker" pos="0.021 -0.013 0.11"/>'
TEXT = actuators.MJCF_PATH.read_text(encoding="utf-8").replace(
    'meshdir="assets"', f'meshdir="{actuators.FOLDER / "assets"}"'
)


def edited(path, *edits):
    """Model file of the shipped one with pieces of its text in the place of others."""
    text = TEXT
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def off_axis(tmp_path_factory):
    """A model whose shaft ends beside the γ axis, as the engine has it and as an actuator."""
    path = tmp_path_factory.mktemp("model") / "bent.xml"
    edited(path, ('<site name="shaft_tip" class="marker" pos="0 0 0.12"/>', OFF_AXIS))
    model = mujoco.MjModel.from_xml_path(str(path))
    return model, mujoco.MjData(model), actuators.load(path)


@given(q=poses)
def test_a_tip_off_the_spin_axis_is_drawn_where_the_engine_has_it(off_axis, q):
    model, data, bent = off_axis
    data.qpos[:] = q[0]
    mujoco.mj_kinematics(model, data)
    # Three rotations of a tenth of a metre, each rounded once or twice.
    np.testing.assert_allclose(shaft_tip(q, bent)[0], data.site("shaft_tip").xpos, atol=4e-16)


def test_a_tip_off_the_spin_axis_circles_as_the_rotor_spins(off_axis):
    gamma = np.linspace(0, 2 * np.pi, 9)[:-1]
    tips = shaft_tip(np.stack([0 * gamma, 0 * gamma, gamma], axis=1), off_axis[2])
    np.testing.assert_allclose(tips[:, 2], 0.11, atol=1e-16)
    np.testing.assert_allclose(np.hypot(tips[:, 0], tips[:, 1]), np.hypot(0.021, 0.013), rtol=1e-14)
    np.testing.assert_allclose(tips.mean(axis=0)[:2], 0, atol=1e-16)


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
def test_each_drawn_coil_looks_up_the_pixel_of_the_actuator_s_coil_there(tmp_path, edits):
    path = edited(tmp_path / "mine.xml", *edits)
    axes = actuators.load(path).coil_axes
    mesh = read_meshes(path)[COILS]
    vertices = np.array(mesh.vertex_positions.as_arrow_array().to_pylist())
    across = np.array(mesh.vertex_texcoords.as_arrow_array().to_pylist())[:, 0]
    drawn, place = np.unique(across, return_inverse=True)
    text = path.read_text(encoding="utf-8")
    assert len(drawn) == 12 * sum(layer in text for layer in (UPPER, MIDDLE, LOWER))
    shipped = read_meshes(actuators.MJCF_PATH)[COILS].vertex_positions.as_arrow_array()
    assert 36 * len(vertices) == 12 * text.count('<geom name="coil_') * len(shipped)  # none is left out
    for i, share in enumerate(drawn):
        centre = vertices[place == i].mean(axis=0)
        # Symmetric about the coil's axis, to the rounding of the mesh files.
        assert centre @ axes[int(share * len(axes))] / np.linalg.norm(centre) > 1 - 1e-6


def test_meshes_stand_where_the_model_puts_them(actuator):
    meshes = read_meshes(actuators.MJCF_PATH)
    coils = np.array(meshes[COILS].vertex_positions.as_arrow_array().to_pylist())
    centres = coils.reshape(36, -1, 3).mean(axis=1)
    directions = centres / np.linalg.norm(centres, axis=1, keepdims=True)
    # Each coil's vertices are symmetric about its axis, to the rounding of the mesh files.
    np.testing.assert_allclose(directions, actuator.coil_axes, atol=1e-4)


def test_all_poles_are_drawn_in_the_colour_of_their_polarity(actuator):
    meshes = read_meshes(actuators.MJCF_PATH)
    for polarity, name in ((1, "north"), (-1, "south")):
        mesh = meshes[f"{WORLD}/rotor/pole_upper_{name}0"]
        vertices = np.array(mesh.vertex_positions.as_arrow_array().to_pylist())
        centres = vertices.reshape(8, -1, 3).mean(axis=1)
        directions = centres / np.linalg.norm(centres, axis=1, keepdims=True)
        axes = actuator.pole_axes[actuator.pole_polarity == polarity]
        # Each direction is one axis of this polarity, and each axis has its pole.
        match = directions @ axes.T > 1 - 1e-6
        np.testing.assert_array_equal(match.sum(axis=0), 1)
        np.testing.assert_array_equal(match.sum(axis=1), 1)


def test_current_colours_tell_sign_and_size():
    idle, small, full, negative = palette.current_colours(np.array([0.0, 2.0, 8.0, -8.0]), 8.0).astype(int)
    assert full[0] > small[0] > idle[0]
    assert negative[2] > full[2]
    np.testing.assert_array_equal(palette.current_colours(np.array([100.0]), 8.0)[0], full)


def height(mjcf):
    """Largest coordinate of all that is drawn but the coils, m."""
    meshes = read_meshes(mjcf)
    drawn = [mesh.vertex_positions for name, mesh in meshes.items() if name != COILS]
    return max(np.max(positions.as_arrow_array().to_pylist()) for positions in drawn)


def metre_up(line):
    """A line of an OBJ file, higher where it is a vertex."""
    if not line.startswith("v "):
        return line
    _, x, y, z = line.split()
    return f"v {x} {y} {float(z) + 1.0}"


def test_an_edited_mesh_is_drawn_as_it_is(tmp_path):
    shutil.copytree(actuators.FOLDER / "assets", tmp_path / "assets")
    mjcf = Path(shutil.copy(actuators.MJCF_PATH, tmp_path / "mine.xml"))
    mesh = tmp_path / "assets" / "shaft.obj"
    before = height(mjcf)
    assert height(mjcf) == before
    mesh.write_text("\n".join(map(metre_up, mesh.read_text().splitlines())))
    # A metre up; the file's digits are cut to single precision.
    np.testing.assert_allclose(height(mjcf), before + 1.0, atol=1e-6)
