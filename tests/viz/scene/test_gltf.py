"""Meshes as binary glTF, read back by another reader of that format."""

import io

import numpy as np
import pytest
import rerun as rr
import trimesh

from spheretwin.models import actuator as actuators
from spheretwin.viz.scene import meshes as gltf
from spheretwin.viz.scene.meshes import read_meshes


def read_back(contents):
    """Vertices and triangles of the one mesh in a file, as trimesh reads them."""
    return trimesh.load(io.BytesIO(contents), file_type="glb", force="mesh", process=False)


def test_every_mesh_is_read_back_as_it_was_written():
    for piece in read_meshes(actuators.MJCF_PATH).others.values():
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


def test_what_is_fixed_in_three_dimensions_takes_half_a_megabyte(tmp_path):
    meshes = read_meshes(actuators.MJCF_PATH)
    with rr.RecordingStream("meshes") as recording:
        recording.set_sinks(rr.FileSink(tmp_path / "meshes.rrd"))
        recording.log("coils", meshes.coils, static=True)
        for entity, piece in meshes.others.items():
            recording.log(entity, *piece.archetypes(), static=True)
        recording.flush()
        recording.disconnect()
    # Half of what a recording may have beside its rows: layouts and texts need the rest.
    assert (tmp_path / "meshes.rrd").stat().st_size < 500_000
