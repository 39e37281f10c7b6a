"""Figures of merit of a run, and the versions behind them."""

import platform
from collections.abc import Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.simulation import Run

PACKAGES = ("spheretwin", "mujoco", "numba", "numpy", "scipy", "pydantic", "pyarrow", "rerun-sdk")

TAIL_TICKS = 256

# Above this share of ticks at the current limit a run says so beside its figures.
SATURATED_SHARE = 0.05


class Figures:
    """Follows a run and reduces it to its figures; its memory grows by a kilobyte for 10,000 ticks.

    Parameters
    ----------
    ticks : int
        Planned. The tail is the second half of the run: from exactly half of the planned ticks on, and in a
        run that ended early from within `TAIL_TICKS` before its half.
    """

    def __init__(self, ticks: int) -> None:
        self._planned = ticks
        self._rows = self._saturated = 0
        self._largest_error, self._largest_current = np.zeros(3), 0.0
        self._squares = np.zeros((1, 3))  # of the error, summed over each piece of the run

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk."""
        if not len(rows):
            return
        error = rows["error_rad"]
        self._largest_error = np.maximum(self._largest_error, np.abs(error).max(axis=0))
        self._largest_current = max(self._largest_current, float(np.abs(rows["current_A"]).max()))
        self._saturated += int(np.count_nonzero(rows["allocation_scale"] < 1))
        pieces = self._piece(np.arange(self._rows, self._rows + len(rows)))
        missing = max(0, int(pieces[-1]) + 1 - len(self._squares))
        self._squares = np.concatenate([self._squares, np.zeros((missing, 3))])
        np.add.at(self._squares, pieces, error**2)
        self._rows += len(rows)

    def note(self, t_s: float, text: str) -> None:
        """It changes no figure."""

    def finish(self, status: str) -> None:
        """Nothing remains to be done."""

    def tracking(self) -> dict[str, Any]:
        """Errors per axis (rad) and currents (A); None where there is no row."""
        if self._rows == 0:
            names = ("max_abs_error_rad", "rms_error_rad", "tail_rms_error_rad")
            return dict.fromkeys((*names, "max_abs_current_A", "saturated_fraction"))
        first = int(self._piece(np.array(self._rows // 2)))
        begins = max(0, self._begin(first))
        return {
            "max_abs_error_rad": self._largest_error.tolist(),
            "rms_error_rad": _rms(self._squares, self._rows),
            "tail_rms_error_rad": _rms(self._squares[first:], self._rows - begins),
            "max_abs_current_A": self._largest_current,
            "saturated_fraction": self._saturated / self._rows,
        }

    def warnings(self) -> list[str]:
        """What the figures alone do not tell of the run; one line each."""
        share = self._saturated / self._rows if self._rows else 0.0
        if share <= SATURATED_SHARE:
            return []
        return [
            f"the current limit cut the torque at {100 * share:.0f} % of the ticks: the figures are those of"
            " the limit more than of the law"
        ]

    def _piece(self, tick: NDArray[np.int64]) -> NDArray[np.int64]:
        """Piece that a tick is in; one begins at half of the planned ticks."""
        offset = self._planned // 2 % TAIL_TICKS
        return (tick - offset) // TAIL_TICKS + 1

    def _begin(self, piece: int) -> int:
        return (piece - 1) * TAIL_TICKS + self._planned // 2 % TAIL_TICKS


def figures_of(run: Run) -> Figures:
    """Figures of a run whose telemetry is in memory."""
    figures = Figures(run.scenario.ticks)
    figures.write(run.telemetry)
    return figures


def summary(
    scenario: Scenario, status: str, figures: Figures, ticks: int, wall_s: float, warnings: Sequence[str]
) -> dict[str, Any]:
    """Figures of a run, ready for JSON; those that need a row are None where it has none."""
    simulated_s = ticks * scenario.controller.period_s
    return {
        "scenario": scenario.model_dump(mode="json"),
        "status": status,
        "simulated_s": simulated_s,
        **figures.tracking(),
        "wall_s": wall_s,
        "realtime_factor": simulated_s / wall_s if wall_s > 0 else None,
        "versions": versions(),
        "warnings": [*warnings, *figures.warnings()],
    }


@cache
def versions() -> dict[str, str]:
    """Version of Python and of every package that a figure may depend on."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def _rms(squares: NDArray[np.float64], rows: int) -> list[float]:
    return np.sqrt(squares.sum(axis=0) / rows).tolist()
