"""The cross-check as a page: every row in Markdown, and the figures that show them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from spheretwin.models.base.check import Check, broken
from spheretwin.twin.crosscheck.figures.registry import FIGURES
from spheretwin.twin.crosscheck.part import Evidence
from spheretwin.viz.figures.drawing import Drawing
from spheretwin.viz.page import markdown as pieces
from spheretwin.viz.page.folder import save_drawings, save_text

PAGE = "crosscheck.md"

HEAD = ("check", "what is compared", "states", "value", "bound", "kept", "why the bound")
NUMBERS = (False, False, True, True, True, False, False)


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
    drawings = [draw(evidence) for draw in FIGURES]
    save_drawings(folder, drawings)
    return save_text(folder / PAGE, markdown(evidence.checks, drawings, versions))


def markdown(checks: list[Check], drawings: list[Drawing], versions: Mapping[str, str]) -> str:
    """Text of the page."""
    names = broken(checks)
    verdict = f"**Broken: {'; '.join(names)}.**" if names else "Every bound is kept."
    used = ", ".join(f"{name} {version}" for name, version in versions.items())
    return "\n".join(
        [
            "# Cross-check",
            "",
            "The engine (MuJoCo) against the Lagrangian model, which knows nothing of it, and against"
            f" Pinocchio. {verdict}",
            "",
            *pieces.table(HEAD, [_row(check) for check in checks], NUMBERS),
            "",
            *map(pieces.figure, drawings),
            f"Made by `spheretwin crosscheck` with {used}.",
            "",
        ]
    )


def _row(check: Check) -> tuple[str, ...]:
    kept = "yes" if check.ok else "**no**"
    figures = f"{check.states:,}", check.value_text(), check.bound_text()
    return check.name, check.compares, *figures, kept, check.why
