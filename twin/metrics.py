"""Figures of merit of a run, and the versions behind them."""

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry import Table
from spheretwin.twin.simulation import Run

PACKAGES = ("spheretwin", "mujoco", "numba", "numpy", "scipy", "pydantic", "pyarrow", "rerun-sdk")


def summary(run: Run) -> dict[str, Any]:
    """Figures of a run, ready for JSON; those that need a row are None where it has none."""
    simulated_s = len(run.telemetry) * run.scenario.controller.period_s
    return {
        "scenario": run.scenario.model_dump(mode="json"),
        "status": run.status,
        "simulated_s": simulated_s,
        **tracking(run.telemetry),
        "wall_s": run.wall_s,
        "realtime_factor": simulated_s / run.wall_s if run.wall_s > 0 else None,
        "versions": versions(),
    }


def tracking(table: Table) -> dict[str, Any]:
    """Errors per axis (rad) and currents of a table; the tail is its second half."""
    if len(table) == 0:
        names = ("max_abs_error_rad", "rms_error_rad", "tail_rms_error_rad")
        return dict.fromkeys((*names, "max_abs_current_A", "saturated_fraction"))
    error = table["error_rad"]
    return {
        "max_abs_error_rad": np.abs(error).max(axis=0).tolist(),
        "rms_error_rad": _rms(error),
        "tail_rms_error_rad": _rms(error[len(error) // 2 :]),
        "max_abs_current_A": float(np.abs(table["current_A"]).max()),
        "saturated_fraction": float(np.mean(table["allocation_scale"] < 1)),
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


def _rms(values: NDArray[np.float64]) -> list[float]:
    return np.sqrt(np.mean(values**2, axis=0)).tolist()
