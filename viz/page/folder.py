"""The folder of a page: found fit before the work, filled after it."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import make_folder, whole_file
from spheretwin.viz.figures.drawing import Drawing


def prepare(folder: Path, *libraries: str) -> None:
    """Find out before a run whether a page can be drawn and written, and leave an empty folder.

    Parameters
    ----------
    folder : Path
    *libraries : str
        What draws, beside matplotlib.

    Raises
    ------
    InputError
        A library is not installed, or the folder cannot be made or written to.
    """
    for library in ("matplotlib", *libraries):
        if find_spec(library) is None:
            raise InputError(
                "output: expected the extra `spheretwin[plots]` to draw figures,"
                f" received an installation without {library}"
            )
    make_folder(folder)


def save_drawings(folder: Path, drawings: Iterable[Drawing], *, vector: bool = False) -> None:
    """Write figures into a folder that exists.

    Parameters
    ----------
    folder : Path
    drawings : iterable of Drawing
    vector : bool
        Write each as SVG beside its PNG, too.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    from spheretwin.viz.figures import plots

    for drawing in drawings:
        plots.save(drawing.figure, folder / drawing.file)
        if vector:
            plots.save(drawing.figure, (folder / drawing.file).with_suffix(".svg"))


def save_text(path: Path, text: str) -> Path:
    """Write a file, whole or not at all; returns its path.

    Raises
    ------
    InputError
        It cannot be written there.
    """
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path
