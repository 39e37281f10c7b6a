"""Take the pictures and clips of the pages: ``python -m tests.screenshots.take [--out DIR] [NAME ...]``.

``--inspect DIR`` takes these and more at five sizes instead, in both themes of the viewer, each also as a
reader with deuteranopia sees it.

A picture shows a new run, recorded and drawn by Rerun's viewer without a screen; or a bench in Chromium, if
the machine has it.
"""

import argparse
import itertools
import subprocess
import sys
import tempfile
import urllib.request
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from spheretwin import scenario as scenarios
from spheretwin.records.outputs import Outputs
from spheretwin.scenario import reading
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.viz.recording.live import RECORDING
from tests.browser import CHROMIUM
from tests.screenshots import clips
from tests.screenshots.bench import screenshot
from tests.screenshots.viewer import DARK, THEMES, HeadlessViewer

PICTURES = Path(__file__).parents[2] / "viz" / "pictures"
WIDTH, HEIGHT = 1280, 800

# A picture of an interface has few colours: these are enough for its shaded coils, in a fourth of the bytes,
# and no colour changes by more than 25 of 255.
COLOURS = 256

SIZES = (800, 600), (1024, 768), (1280, 800), (1920, 1080), (2560, 1440)

# Machado, Oliveira and Fernandes (2009), severity 1, on linear light.
DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
)


class Recorded(NamedTuple):
    """A moment of a run, in one of its views."""

    runs: dict[str, str]
    """Scenario and flags of each by the name of its file; two or more are merged."""
    view: str
    t_s: float
    live: bool = False
    """True for what a live view receives, which has one view."""


class Driven(NamedTuple):
    """A bench, its tip dragged from place to place."""

    run: str
    """Scenario and flags."""
    poses_deg: tuple[tuple[float, float], ...]
    """Angles α and β that the tip is dragged to."""


OPEN = "--fault.0.target coil.04 --fault.0.mode open --fault.0.start-s 3"
BROKEN = {"open": f"tilt --hardware electronics {OPEN}"}
LAWS = ("afsm", "adaptive_fuzzy", "pd")
FAILING = "sinusoid --controller.law pd --disturbance.load 2"

TABLE: dict[str, Recorded | Driven] = {
    "overview": Recorded({"nutation": "nutation"}, "overview", 3.4),
    "control": Recorded({"nutation": "nutation"}, "control", 3.4),
    "coils": Recorded({"loaded": "sinusoid --plant.payload-kg 0.1 --disturbance.load 2"}, "coils", 3.3),
    "hardware": Recorded(BROKEN, "hardware", 4.4),
    "compare": Recorded({law: f"sinusoid --controller.law {law}" for law in LAWS}, "compare", 3.4),
    "desired": Recorded({"nutation": "nutation"}, "compare", 3.4),
    "failed": Recorded({"failing": FAILING}, "overview", 1.222),
    "bench": Driven("hold --plant.payload-kg 0.1", ((10.0, -20.0), (-20.0, -5.0), (5.0, 25.0))),
}


MORE: dict[str, Recorded | Driven] = {
    "scenario": Recorded({"nutation": "nutation"}, "scenario", 3.4),
    "open_overview": Recorded(BROKEN, "overview", 4.4),
    "open_control": Recorded(BROKEN, "control", 4.4),
    "failed_control": Recorded({"failing": FAILING}, "control", 1.222),
    "compare_failed": Recorded({"afsm": "sinusoid --disturbance.load 2", "pd": FAILING}, "compare", 1.0),
    "live": Recorded({"nutation": "nutation"}, "overview", 3.4, live=True),
}
"""Pictures for an inspection only."""

NOT_TAKEN = "{}: not taken: no Chromium on this machine"

CLIPS = {"nutation_clip": TABLE["overview"], "bench_clip": TABLE["bench"]}
"""Run and drags of each clip."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    known = TABLE | MORE | CLIPS
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(known)}")
    parser.add_argument("--out", type=Path, default=PICTURES, metavar="DIR")
    parser.add_argument("--size", default=f"{WIDTH}x{HEIGHT}", metavar="WIDTHxHEIGHT")
    shown = "all sizes, both themes and a simulation of colours"
    parser.add_argument("--inspect", type=Path, metavar="DIR", help=shown)
    options = parser.parse_args()
    for name in options.names:
        if name not in known:
            parser.error(f"expected one of {', '.join(known)}, received {name}")
    if not options.inspect:
        size = tuple(map(int, options.size.split("x")))
        for name in options.names or [*TABLE, *CLIPS]:
            if name in CLIPS:
                save_clip(name, CLIPS[name], options.out)
                continue
            for _, _, picture in pictures_of(name, known[name], [size], [DARK]):
                save(picture, options.out / f"{name}.png")
        return
    for name in options.names or TABLE | MORE:
        for (width, height), theme, picture in pictures_of(name, known[name], SIZES, THEMES):
            folder = options.inspect / f"{width}x{height}"
            save(picture, folder / f"{name}_{theme}.png")
            save(as_deuteranope(picture), folder / f"{name}_{theme}_deuteranopia.png")


Size = tuple[int, int]


def pictures_of(
    name: str, row: Recorded | Driven, sizes: Sequence[Size], themes: Sequence[str]
) -> Iterator[tuple[Size, str, Image.Image]]:
    """Yield the pictures of a row, each with size and theme; none if this machine cannot take them."""
    with tempfile.TemporaryDirectory() as work:
        recording = recorded(row, Path(work)) if isinstance(row, Recorded) else None
        if not recording and not CHROMIUM:
            print(NOT_TAKEN.format(name), file=sys.stderr)
            return
        for size, theme in itertools.product(sizes, themes):
            if recording:
                yield size, theme, viewer_picture(name, recording, row.t_s, size, theme)
            else:
                light = theme != DARK
                yield size, theme, screenshot(row.run.split(), row.poses_deg, size, Path(work), light)


def save_clip(name: str, row: Recorded | Driven, out: Path) -> None:
    """Write a clip, unless this machine cannot take it."""
    with tempfile.TemporaryDirectory() as work:
        if isinstance(row, Recorded):
            frames = clips.nutation(recorded(row, Path(work)))
        elif CHROMIUM:
            frames = clips.bench(row.run.split(), row.poses_deg, Path(work))
        else:
            print(NOT_TAKEN.format(name), file=sys.stderr)
            return
    clips.save(frames, out / f"{name}.webp")


def save(picture: Image.Image, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    few = picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE)
    few.save(path, optimize=True)
    print(path)


def as_deuteranope(picture: Image.Image) -> Image.Image:
    """The picture as a reader with deuteranopia sees it."""
    encoded = np.asarray(picture.convert("RGB")) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    seen_light = np.clip(linear @ DEUTERANOPIA.T, 0, 1)
    shown = np.where(seen_light <= 0.0031308, 12.92 * seen_light, 1.055 * seen_light ** (1 / 2.4) - 0.055)
    return Image.fromarray(np.round(255 * shown).astype(np.uint8))


def viewer_picture(name: str, recording: Path, t_s: float, size: Size, theme: str) -> Image.Image:
    """Return a moment of a recording, as a viewer draws it; report what the viewer cannot draw."""
    with HeadlessViewer(*size, theme) as viewer:  # a new one: a viewer keeps the former layout
        viewer.open(recording)
        image = viewer.at(t_s)
        for fault in viewer.faults():
            print(f"{name}: {fault}", file=sys.stderr)
    return image


def recorded(picture: Recorded, folder: Path) -> Path:
    """Recording of the picture's run, or of all its runs side by side."""
    paths = [folder / f"{name}.rrd" for name in picture.runs]
    for flags, path in zip(picture.runs.values(), paths, strict=True):
        if picture.live:
            return live_recording(flags.split(), path)
        view = [] if len(paths) > 1 else ["--view", picture.view]
        spheretwin("simulate", *flags.split(), *view, "--record", path)
    if len(paths) == 1:
        return paths[0]
    spheretwin("review", *paths, "--merge", folder / "merged.rrd")
    return folder / "merged.rrd"


def live_recording(run: list[str], path: Path) -> Path:
    """Save what a live view of a run receives."""
    with Session(scenarios.load(run[0], reading.overrides(run[1:]))) as session:
        outputs = Outputs(session, None, None, live=True)
        follow(session, session.scenario.ticks, outputs.sinks)
        stream = urllib.request.urlopen(outputs._live.address.rstrip("/") + RECORDING)
        outputs.close()
        path.write_bytes(stream.read())
    return path


def spheretwin(*arguments: str | Path) -> None:
    """Run the command; a run that ends early is a picture too."""
    command = [sys.executable, "-m", "spheretwin", *arguments, "--json"]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    if "Traceback" in done.stderr or done.returncode == 2:
        raise SystemExit(done.stderr)


if __name__ == "__main__":
    main()
