"""Take the pictures that the READMEs show: ``python -m tests.screenshots.take [--out DIR] [NAME ...]``.

``--inspect DIR`` takes them at five sizes instead, each also as a reader with deuteranopia sees it.

Each is a run made anew, recorded, and drawn by Rerun's viewer without a screen; or a bench that is driven in
Chromium, where the machine has it.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from tests.browser import CHROMIUM
from tests.screenshots.bench import drawn
from tests.screenshots.viewer import HeadlessViewer

PICTURES = Path(__file__).parents[2] / "viz" / "pictures"
WIDTH, HEIGHT = 1280, 800

# A picture of an interface has few colours: these are enough for its shaded coils, in a fifth of the bytes.
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


class Driven(NamedTuple):
    """A bench, its tip dragged from place to place."""

    run: str
    """Scenario and flags."""
    poses_deg: tuple[tuple[float, float], ...]
    """Angles α and β that the tip is dragged to."""


OPEN = "--fault.0.target coil.04 --fault.0.mode open --fault.0.start-s 3"
FAILING = "sinusoid --controller.law pd --disturbance.load 2"

TABLE: dict[str, Recorded | Driven] = {
    "overview": Recorded({"nutation": "nutation"}, "overview", 3.4),
    "control": Recorded({"nutation": "nutation"}, "control", 3.4),
    "coils": Recorded({"loaded": "sinusoid --plant.payload-kg 0.1 --disturbance.load 2"}, "coils", 3.3),
    "hardware": Recorded(
        {"open": f"tilt --hardware prototype {OPEN}"},
        "hardware",
        4.4,
    ),
    "compare": Recorded(
        {law: f"sinusoid --controller.law {law}" for law in ("afsm", "adaptive_fuzzy", "pd")},
        "compare",
        3.4,
    ),
    "desired": Recorded({"nutation": "nutation"}, "compare", 3.4),
    "failed": Recorded({"failing": FAILING}, "overview", 1.222),
    "bench": Driven("hold --plant.payload-kg 0.1", ((10.0, -20.0), (-20.0, -5.0), (5.0, 25.0))),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(TABLE)}; all unless given")
    parser.add_argument("--out", type=Path, default=PICTURES, metavar="DIR")
    parser.add_argument("--size", default=f"{WIDTH}x{HEIGHT}", metavar="WIDTHxHEIGHT")
    parser.add_argument(
        "--inspect", type=Path, metavar="DIR", help="take all sizes and a simulation of colours"
    )
    options = parser.parse_args()
    for name in options.names:
        if name not in TABLE:
            parser.error(f"expected one of {', '.join(TABLE)}, received {name}")
    size = tuple(map(int, options.size.split("x")))
    for width, height in SIZES if options.inspect else [size]:
        folder = options.inspect / f"{width}x{height}" if options.inspect else options.out
        for name in options.names or TABLE:
            with tempfile.TemporaryDirectory() as work:
                picture = taken(name, (width, height), Path(work))
            if not picture:
                continue
            save(picture, folder / f"{name}.png")
            if options.inspect:
                save(as_deuteranope(picture), folder / f"{name}_deuteranopia.png")


def taken(name: str, size: tuple[int, int], folder: Path) -> Image.Image | None:
    """A picture of the table, or None where this machine cannot take it."""
    row = TABLE[name]
    if isinstance(row, Recorded):
        return seen(name, row, folder / name, size)
    if CHROMIUM:
        return drawn(row.run.split(), row.poses_deg, size, folder)
    print(f"{name}: not taken: no Chromium on this machine", file=sys.stderr)
    return None


def save(picture: Image.Image, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.quantize(COLOURS).save(path, optimize=True)
    print(path)


def as_deuteranope(picture: Image.Image) -> Image.Image:
    """The picture as a reader with deuteranopia sees it."""
    encoded = np.asarray(picture.convert("RGB")) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    seen_light = np.clip(linear @ DEUTERANOPIA.T, 0, 1)
    shown = np.where(seen_light <= 0.0031308, 12.92 * seen_light, 1.055 * seen_light ** (1 / 2.4) - 0.055)
    return Image.fromarray(np.round(255 * shown).astype(np.uint8))


def seen(name: str, picture: Recorded, folder: Path, size: tuple[int, int]) -> Image.Image:
    """The picture's moment, as a viewer draws it; what the viewer cannot draw is said."""
    recording = recorded(picture, folder)
    with HeadlessViewer(*size) as viewer:  # each anew: a viewer keeps what it was shown last
        viewer.open(recording)
        image = viewer.at(picture.t_s)
        for fault in viewer.faults():
            print(f"{name}: {fault}", file=sys.stderr)
    return image


def recorded(picture: Recorded, folder: Path) -> Path:
    """Recording of the picture's run, or of all its runs side by side."""
    folder.mkdir()
    paths = [folder / f"{name}.rrd" for name in picture.runs]
    for flags, path in zip(picture.runs.values(), paths, strict=True):
        view = [] if len(paths) > 1 else ["--view", picture.view]
        spheretwin("simulate", *flags.split(), *view, "--record", path)
    if len(paths) == 1:
        return paths[0]
    spheretwin("review", *paths, "--merge", folder / "merged.rrd")
    return folder / "merged.rrd"


def spheretwin(*arguments: str | Path) -> None:
    """Run the command; a run that ends early is a picture too."""
    command = [sys.executable, "-m", "spheretwin", *arguments, "--json"]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    if "Traceback" in done.stderr or done.returncode == 2:
        raise SystemExit(done.stderr)


if __name__ == "__main__":
    main()
