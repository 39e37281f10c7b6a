"""Clip of runs: path of the shaft's tip and tracking errors, with the present of the run in each frame."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3D
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.base.files import make_folder, whole_file
from spheretwin.viz.comparison.runs import ComparedRun
from spheretwin.viz.figures.style import FAINT, INK, draw_line, name_runs, plain, run_styles
from spheretwin.viz.quantities import ERROR_ANGLE
from spheretwin.viz.scene.places import shaft_tip

FRAMES_s = 25
"""Frames for each second of a run."""

SIZE_in, DPI = (12.8, 7.2), 100
"""Size of a frame: 1280 x 720 pixels."""

Image = NDArray[np.uint8]


class Clip:
    """Figure of a clip.

    Parameters
    ----------
    runs : sequence of ComparedRun
    title : str

    Attributes
    ----------
    figure : Figure
    end_s : float
        Last time of all runs.
    """

    def __init__(self, runs: Sequence[ComparedRun], title: str) -> None:
        self.figure = Figure(figsize=SIZE_in, dpi=DPI, layout="constrained")
        self.end_s = max(float(run.table["t_s"][-1]) for run in runs)
        grid = self.figure.add_gridspec(1, 2)
        self._space, errors = (
            self.figure.add_subplot(grid[0], projection="3d"),
            self.figure.add_subplot(grid[1]),
        )
        self.figure.suptitle(title, fontsize="medium", color=INK)
        self._moving: list[tuple[Array, Array, Line3D, Line3D]] = []
        for run, style in zip(runs, run_styles(runs), strict=True):
            t_s, actuator = run.table["t_s"], run.rows.actuator
            self._space.plot(
                *(1e3 * shaft_tip(run.table["q_ref_rad"], actuator)).T, color=FAINT, linewidth=0.8
            )
            (path,) = self._space.plot([], [], [], **style.line())
            (point,) = self._space.plot([], [], [], "o", color=style.colour, markersize=7)
            self._moving.append((t_s, 1e3 * shaft_tip(run.table["q_rad"], actuator), path, point))
            draw_line(errors, t_s, ERROR_ANGLE.column(run.rows), label=run.label, **style.line())
        for name, limits in zip("xyz", _limits([tip for _, tip, *_ in self._moving]), strict=True):
            self._space.set(**{f"{name}lim": limits, f"{name}label": f"{name}, mm"})
        self._space.set_box_aspect((1, 1, 1))
        errors.set(xlim=(0.0, self.end_s), xlabel="time, s")
        plain(errors, f"{ERROR_ANGLE.title}, °")
        name_runs(self.figure, errors)
        self._now = errors.axvline(0.0, color=INK, linewidth=1.0)

    def show(self, t_s: float) -> None:
        """Show a time: each path up to it, and the error's cursor at it."""
        self._now.set_xdata([t_s, t_s])
        for times_s, tip_mm, path, point in self._moving:
            count = int(np.searchsorted(times_s, t_s, side="right"))
            path.set_data_3d(*tip_mm[:count].T)
            point.set_data_3d(*tip_mm[max(count - 1, 0) : max(count, 1)].T)
        self._space.set_title(f"shaft's tip at {t_s:.2f} s; grey: reference", fontsize="small", color=INK)


def frames(runs: Sequence[ComparedRun], title: str) -> Iterator[Image]:
    """Yield the frames of a clip, (height, width, 4), from 0 to the last tick of all runs."""
    clip = Clip(runs, title)
    canvas = FigureCanvasAgg(clip.figure)
    for t_s in np.arange(0.0, clip.end_s + 0.5 / FRAMES_s, 1 / FRAMES_s):
        clip.show(float(t_s))
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())


def _limits(paths: Sequence[Array]) -> Array:
    """Return the limits of a cube around paths, (3, 2)."""
    points = np.concatenate(paths)
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    middle, half = (low + high) / 2, max(1.0, 0.55 * float(np.max(high - low)))
    return np.stack([middle - half, middle + half], axis=1)


def encoder() -> str | None:
    """Return the program FFmpeg of the package imageio-ffmpeg, or of the system; None if there is none."""
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        return shutil.which("ffmpeg")


def write(path: Path, runs: Sequence[ComparedRun], title: str) -> Path:
    """Write a clip; without an encoder its frames as PNG into a folder with the name of the clip.

    Parameters
    ----------
    path : Path
        Of an MP4.
    runs : sequence of ComparedRun
    title : str

    Returns
    -------
    Path
        The clip, or the folder of its frames.

    Raises
    ------
    SpheretwinError
        The encoder or the disk refuses it.
    """
    program = encoder()
    if program is None:
        return _write_frames(path.with_suffix(""), runs, title)
    width, height = (round(DPI * side) for side in SIZE_in)
    raw = ["-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}", "-r", f"{FRAMES_s}", "-i", "-"]
    coded = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]
    with whole_file(path) as temporary:
        command = [program, "-y", "-loglevel", "error", *raw, *coded, str(temporary)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            assert process.stdin is not None  # it is a pipe
            with suppress(BrokenPipeError):  # its message states why it has ended
                for frame in frames(runs, title):
                    process.stdin.write(frame.tobytes())
            _, message = process.communicate()
        if process.returncode:
            reason = " ".join(message.decode(errors="replace").split())
            raise SpheretwinError(f"video: {path} could not be written, {program}: {reason}")
    return path


def _write_frames(folder: Path, runs: Sequence[ComparedRun], title: str) -> Path:
    from matplotlib.image import imsave

    make_folder(folder)
    for place, frame in enumerate(frames(runs, title)):
        with whole_file(folder / f"frame_{place:05}.png") as temporary:
            imsave(temporary, frame, format="png", dpi=DPI)
    return folder
