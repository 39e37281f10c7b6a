"""The cross-check as a page: every row in Markdown, and the figures that show them."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from spheretwin.models.base.check import Check, broken
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import make_folder, whole_file
from spheretwin.twin.crosscheck.figures.drawing import Drawing
from spheretwin.twin.crosscheck.figures.registry import FIGURES
from spheretwin.twin.crosscheck.part import Evidence

PAGE = "crosscheck.md"


def prepare(folder: Path) -> None:
    """Find out before the run whether the page can be drawn and written, and leave an empty folder.

    Raises
    ------
    InputError
        matplotlib is not installed, or the folder cannot be made or written to.
    """
    if find_spec("matplotlib") is None:
        raise InputError(
            "output: expected the extra `spheretwin[plots]` to draw figures,"
            " received an installation without matplotlib"
        )
    make_folder(folder)


def write(folder: Path, evidence: Evidence, versions: Mapping[str, str]) -> Path:
    """Write the page and its figures into a folder; returns the page.

    Parameters
    ----------
    folder : Path
        Exists.
    evidence : Evidence
        What the suite left.
    versions : mapping
        Version by package, for the foot of the page.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    from spheretwin.viz.figures import plots

    drawings = [draw(evidence) for draw in FIGURES]
    for drawing in drawings:
        plots.save(drawing.figure, folder / drawing.file)
    page = folder / PAGE
    with whole_file(page) as temporary:
        temporary.write_text(markdown(evidence.checks, drawings, versions), encoding="utf-8")
    return page


def markdown(checks: list[Check], drawings: list[Drawing], versions: Mapping[str, str]) -> str:
    """Text of the page."""
    names = broken(checks)
    verdict = f"**Broken: {'; '.join(names)}.**" if names else "Every bound is kept."
    rows = [
        f"| {_cell(check.name)} | {_cell(check.compares)} | {check.states:,} | {check.value_text()}"
        f" | {check.bound_text()} | {'yes' if check.ok else '**no**'} | {_cell(check.why)} |"
        for check in checks
    ]
    figures = [f"![{drawing.caption}]({drawing.file})\n\n*{drawing.caption}*\n" for drawing in drawings]
    used = ", ".join(f"{name} {version}" for name, version in versions.items())
    return "\n".join(
        [
            "# Cross-check",
            "",
            "The engine (MuJoCo) against the Lagrangian model, which knows nothing of it, and against"
            f" Pinocchio. {verdict}",
            "",
            "| check | what is compared | states | value | bound | kept | why the bound |",
            "|---|---|---:|---:|---:|---|---|",
            *rows,
            "",
            *figures,
            f"Made by `spheretwin crosscheck` with {used}.",
            "",
        ]
    )


def _cell(text: str) -> str:
    """Text in which no bar ends a cell of the table."""
    return text.replace("|", "\\|")
