"""Clip of a run: frames at the pace of the run, each with the tip and the error of its time."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.image import imread

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.viz.figures import video
from tests.viz.comparison.compared import run_of

TIP_m = np.array([0.0, 0.0, 0.1])


@pytest.fixture(scope="module")
def run():
    """A turn of α at 1 rad/s: the tip moves along -y."""
    run = run_of(1e-3 * np.arange(121))
    return run._replace(rows=run.rows._replace(actuator=SimpleNamespace(shaft_tip_m=TIP_m)))


@pytest.mark.parametrize("t_s", [0.0, 0.05, 0.12])
def test_a_frame_has_the_path_until_its_time_and_a_cursor_there(run, t_s):
    clip = video.Clip([run], "title")
    clip.show(t_s)
    space, errors = clip.figure.axes
    _, path, point = space.lines
    x = path.get_data_3d()[0]
    assert len(x) == round(1e3 * t_s) + 1
    np.testing.assert_allclose(
        np.ravel(point.get_data_3d()), [0.0, -100 * np.sin(t_s), 100 * np.cos(t_s)], atol=1e-9
    )
    assert errors.lines[-1].get_xdata() == [t_s, t_s]
    assert f"{t_s:.2f} s" in space.get_title()
    assert errors.get_xlim() == (0.0, pytest.approx(0.12))


def test_without_an_encoder_the_frames_are_files(run, tmp_path, monkeypatch):
    monkeypatch.setattr(video, "encoder", lambda: None)
    folder = video.write(tmp_path / "clip.mp4", [run], "title")
    assert folder == tmp_path / "clip"
    images = sorted(folder.iterdir())
    assert [image.name for image in images] == [f"frame_{place:05}.png" for place in range(4)]
    assert imread(images[0]).shape[:2] == (720, 1280)
    assert np.any(imread(images[0]) != imread(images[-1]))


def test_an_encoder_gets_every_frame_and_makes_the_file(run, tmp_path, monkeypatch):
    program = tmp_path / "encoder"
    program.write_text('#!/bin/sh\nfor path; do :; done\ncat > "$path"\n')
    program.chmod(0o755)
    monkeypatch.setattr(video, "encoder", lambda: str(program))
    path = video.write(tmp_path / "clip.mp4", [run], "title")
    assert path.stat().st_size == 4 * 1280 * 720 * 4


def test_the_message_of_an_encoder_is_reported(run, tmp_path, monkeypatch):
    program = tmp_path / "encoder"
    program.write_text("#!/bin/sh\necho no codec >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setattr(video, "encoder", lambda: str(program))
    with pytest.raises(SpheretwinError, match=r"clip.mp4 could not be written, .*encoder: no codec"):
        video.write(tmp_path / "clip.mp4", [run], "title")
    assert not (tmp_path / "clip.mp4").exists()
