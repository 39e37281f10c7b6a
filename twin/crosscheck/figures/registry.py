"""All figures of the cross-check, in the order of the page: a new one is a file and a row."""

from __future__ import annotations

from collections.abc import Callable

from spheretwin.twin.crosscheck.figures import (
    closed_loop,
    convergence,
    differences,
    friction,
    margins,
    torque_free,
    trajectory,
)
from spheretwin.twin.crosscheck.part import Evidence
from spheretwin.viz.figures.drawing import Drawing

FIGURES: tuple[Callable[[Evidence], Drawing], ...] = (
    margins.draw,
    differences.draw,
    trajectory.draw,
    convergence.draw,
    torque_free.draw,
    friction.draw,
    closed_loop.draw,
)
