"""A model whose mesh files are missing: no run needs them; a recording leaves them out and says so."""

import shutil

from spheretwin.models import mjcf
from spheretwin.models.actuator import MJCF_PATH
from spheretwin.viz.scene.meshes import read_meshes


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
