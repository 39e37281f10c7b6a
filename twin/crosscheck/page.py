"""The cross-check as a page: every row in Markdown, and the figures that show them."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spheretwin.models.base.check import Check, broken
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import make_folder, whole_file
from spheretwin.twin.crosscheck import closed_loop, dynamics, free_rotor, trajectories
from spheretwin.twin.crosscheck.suite import Evidence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "crosscheck.md"


class Drawing(NamedTuple):
    """A figure, the file it goes to, and what it shows."""

    file: str
    caption: str
    figure: Figure


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

    drawings = draw(evidence)
    for drawing in drawings:
        plots.save(drawing.figure, folder / drawing.file)
    page = folder / PAGE
    with whole_file(page) as temporary:
        temporary.write_text(markdown(evidence.checks, drawings, versions), encoding="utf-8")
    return page


def draw(evidence: Evidence) -> list[Drawing]:
    """All figures."""
    return [
        _margins(evidence),
        _dynamics(evidence),
        _trajectory(evidence),
        _convergence(evidence),
        _free_rotor(evidence),
        _closed_loop(evidence),
    ]


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


def _margins(evidence: Evidence) -> Drawing:
    from spheretwin.viz.figures import plots

    shares = {
        check.name: check.value / check.bound if np.isfinite(check.value) else np.inf
        for check in evidence.checks
        if check.value is not None and check.bound is not None and check.at_least is None
    }
    figure = plots.margins(shares, "How much of its bound each figure takes up")
    return Drawing(
        "margins.png", "Value over bound; the orders of convergence, which have two, are below.", figure
    )


def _dynamics(evidence: Evidence) -> Drawing:
    from spheretwin.viz.figures import plots

    bounds = {quantity.name: quantity.bound for quantity in dynamics.QUANTITIES}
    figure = plots.spreads(
        evidence.dynamics.differences, bounds, "Engines against the Lagrangian at random states"
    )
    caption = "Relative differences at random states of all three plants; 1e-18 stands for none at all."
    return Drawing("dynamics.png", caption, figure)


def _trajectory(evidence: Evidence) -> Drawing:
    from spheretwin.viz.figures import plots

    followed = evidence.trajectories
    figure = plots.motion(
        followed.t_s,
        followed.q_rad,
        followed.difference_rad,
        trajectories.BOUND_rad,
        "MuJoCo RK4 against DOP853 on the Lagrangian, torques held over 10 ms",
    )
    return Drawing(
        "trajectory.png", "Nutation by given torques, and how far engine and reference part.", figure
    )


def _convergence(evidence: Evidence) -> Drawing:
    from spheretwin.viz.figures import plots

    slopes = {name: plots.Slope(*measured) for name, measured in evidence.trajectories.convergence.items()}
    figure = plots.convergence(slopes, "Order of convergence against DOP853")
    return Drawing("convergence.png", "Largest error over 5 s at five steps, with the fitted slopes.", figure)


def _free_rotor(evidence: Evidence) -> Drawing:
    from spheretwin.viz.figures import plots

    axis = {
        "energy": "energy, relative",
        "angular momentum": "angular momentum,\nrelative",
        "attitude": "attitude, rad",
    }
    panels = {
        axis[quantity]: {
            f"{spin} rad/s": plots.Bounded(drift.values, drift.bound) for spin, drift in by_spin.items()
        }
        for quantity, by_spin in evidence.free_rotor.drifts.items()
    }
    title = f"Torque-free rotor over {free_rotor.DURATION_s:g} s, by spin rate"
    figure = plots.drifts(evidence.free_rotor.t_s, panels, title)
    caption = "Drift of energy and angular momentum, and attitude against Euler's exact solution at J1 = J2."
    return Drawing("torque_free.png", caption, figure)


def _closed_loop(evidence: Evidence) -> Drawing:
    from spheretwin.viz.figures import plots

    pairs = evidence.closed_loop.pairs
    longest = max(pairs.values(), key=lambda pair: len(pair.mujoco))
    errors = {law: (pair.mujoco["error_rad"], pair.lagrangian["error_rad"]) for law, pair in pairs.items()}
    bounds = {"PD": closed_loop.PD_BOUND_rad, "AFSM": None}
    apart = {law: plots.Bounded(pair.difference_rad, bounds[law]) for law, pair in pairs.items()}
    titles = {"PD": "PD, load 0.5", "AFSM": "AFSM, load 2"}
    figure = plots.closed_loops(
        longest.mujoco["t_s"],
        {titles[law]: pair for law, pair in errors.items()},
        {titles[law]: series for law, series in apart.items()},
        ("MuJoCo", "Lagrangian"),
        "The nutation in closed loop on two plants",
    )
    return Drawing(
        "closed_loop.png", "The same run on MuJoCo and on the Lagrangian under our own RK4.", figure
    )
