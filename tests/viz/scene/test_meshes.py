"""Meshes as binary glTF, read back by another reader, and models whose mesh files are missing."""

import io
import shutil

import numpy as np
import pytest
import trimesh

from spheretwin.models import mjcf
from spheretwin.models.actuator import MJCF_PATH
from spheretwin.viz.scene import meshes as gltf
from spheretwin.viz.scene.meshes import read_meshes


def read_back(contents):
    """Vertices and triangles of the one mesh in a file, as trimesh reads them."""
    return trimesh.load(io.BytesIO(contents), file_type="glb", force="mesh", process=False)


def test_every_mesh_is_read_back_as_it_was_written():
    for piece in read_meshes(MJCF_PATH).others.values():
        result = read_back(gltf.binary(piece.positions, piece.triangles))
        np.testing.assert_array_equal(result.vertices, piece.positions.astype(np.float32))
        np.testing.assert_array_equal(result.faces, piece.triangles)
        # Files of tenths of a micrometre, in single precision; a mesh turned inside out has less than none.
        assert result.volume > 0


@pytest.mark.parametrize("count", [0xFFFF, 0x10000 + 2])
def test_meshes_of_more_vertices_than_two_bytes_count_are_whole(count):
    positions = np.random.default_rng(0).normal(size=(count, 3))
    triangles = np.array([[0, 1, count - 1], [count - 3, count - 2, count - 1]])
    result = read_back(gltf.binary(positions, triangles))
    np.testing.assert_array_equal(result.vertices, positions.astype(np.float32))
    np.testing.assert_array_equal(result.faces, triangles)


def test_a_copy_without_meshes_is_drawn_without_them_and_warns(tmp_path):
    copy = shutil.copy(MJCF_PATH, tmp_path / "copy.xml")
    meshes = read_meshes(copy)
    assert (meshes.coils, meshes.others) == (None, {})
    (line,) = mjcf.read(copy).warnings
    assert "recordings do not draw stator.obj" in line
    assert mjcf.read(MJCF_PATH).warnings == ()


def test_the_meshes_that_are_there_are_drawn(tmp_path):
    copy = shutil.copy(MJCF_PATH, tmp_path / "copy.xml")
    (tmp_path / "assets").mkdir()
    shutil.copy(MJCF_PATH.parent / "assets" / "ball.obj", tmp_path / "assets")
    assert list(read_meshes(copy).others) == ["world/rotor/ball"]
    (line,) = mjcf.read(copy).warnings
    assert "ball" not in line
