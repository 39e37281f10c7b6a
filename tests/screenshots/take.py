"""Take the pictures that the READMEs show: ``python -m tests.screenshots.take [--out DIR] [NAME ...]``.

Each is a run made anew, recorded, and drawn by Rerun's viewer without a screen; or a bench that is driven in
Chromium, where the machine has it.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from PIL import Image

from tests.browser import CHROMIUM
from tests.screenshots.bench import drawn
from tests.screenshots.viewer import HeadlessViewer

PICTURES = Path(__file__).parents[2] / "viz" / "pictures"
WIDTH, HEIGHT = 1280, 800

# A picture of an interface has few colours: these are enough for its shaded coils, in a fifth of the bytes.
COLOURS = 256


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
    options = parser.parse_args()
    for name in options.names:
        if name not in TABLE:
            parser.error(f"expected one of {', '.join(TABLE)}, received {name}")
    options.out.mkdir(parents=True, exist_ok=True)
    width, height = map(int, options.size.split("x"))
    with tempfile.TemporaryDirectory() as folder:
        for name in options.names or TABLE:
            row = TABLE[name]
            if isinstance(row, Recorded):
                picture = seen(name, row, Path(folder) / name, (width, height))
            elif CHROMIUM:
                picture = drawn(row.run.split(), row.poses_deg, (width, height), Path(folder))
            else:
                print(f"{name}: not taken: no Chromium on this machine", file=sys.stderr)
                continue
            path = options.out / f"{name}.png"
            picture.quantize(COLOURS).save(path, optimize=True)
            print(path)


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
