"""``spheretwin magnetics map``: the torque available in every direction, over the workspace."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from spheretwin.models import actuator as actuators
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.check import Check
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import make_folder
from spheretwin.models.design import warnings as magnetics_warnings
from spheretwin.models.design import workspace as workspaces
from spheretwin.models.design.capability import Capability, capability
from spheretwin.models.design.weakest import FIGURES, Found, local_minima, worst_by_tilt
from spheretwin.models.design.workspace import Workspace
from spheretwin.twin.commands.reporting import kept, print_json, tracked, warn
from spheretwin.viz.terminal import magnetic_tables

TILT_STEP_DEG = 1.0

# Weak poses told of each figure.
TOLD = {"least_norm": 3, "best": 1, "singular_value": 1}

ROUNDING = 1e-9


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the part; True when every bound is kept."""
    if rest:
        raise InputError(
            "command line: expected --csv, --mjcf, --out, --need, --largest-tilt or --json,"
            f" received {' '.join(rest)}"
        )
    plots = _plots() if options.out else None
    actuator = actuators.load(options.mjcf, options.csv)
    if options.out:
        make_folder(options.out)
    workspace = workspaces.grid(actuator, options.largest_tilt, TILT_STEP_DEG)
    if not workspace.reachable.any():
        raise InputError("magnetics map: expected hinge ranges that hold some pose, received none")
    flat = capability(workspace.q.reshape(-1, 3), actuator, tracked("torque capability"))
    on_grid = flat.reshaped(workspace.reachable.shape)
    worst = {name: worst_by_tilt(workspace, on_grid, figure, actuator) for name, figure in FIGURES.items()}
    weak = {name: local_minima(workspace, worst[name], FIGURES[name], actuator) for name in TOLD}
    warnings = [*magnetics_warnings.of_geometry(actuator), *_lost(worst["condition"])]
    warn(warnings)
    checks = _checks(workspace, on_grid, weak["least_norm"], options.need)
    figures: dict[str, Any] = {
        "largest_tilt_deg": options.largest_tilt,
        "poses": int(workspace.reachable.sum()),
        "current_limit_A": actuator.group.current_limit_A,
        "by_tilt": _by_tilt(workspace, on_grid, worst),
        "weakest": [row for name, count in TOLD.items() for row in _told(name, weak[name], count)],
        "checks": [check.row() for check in checks],
        "warnings": warnings,
    }
    files = _draw(plots, options.out, workspace, on_grid, worst, actuator) if plots else []
    if options.json:
        print_json({**figures, "figures": [str(path) for path in files]})
    else:
        magnetic_tables.print_map(figures)
        magnetic_tables.print_checks(figures["checks"])
        magnetic_tables.print_files(files)
    return kept("magnetics map", checks)


def _plots() -> ModuleType:
    try:
        return import_module("spheretwin.viz.figures.magnetic_plots")
    except ModuleNotFoundError as error:
        raise InputError(
            "magnetics map: expected the extra `spheretwin[plots]` to draw figures,"
            f" received an installation without {error.name}"
        ) from None


def _draw(
    plots: ModuleType,
    folder: Path,
    workspace: Workspace,
    on_grid: Capability,
    worst: dict[str, Found],
    actuator: Actuator,
) -> list[Path]:
    limit_A = actuator.group.current_limit_A
    by_tilt = {
        "least_norm_Nm": worst["least_norm"].capability.least_norm_Nm,
        "best_Nm": worst["best"].capability.best_Nm,
        "copper_W_per_Nm2": worst["singular_value"].capability.copper_W_per_Nm2,
    }
    drawn = {
        "capability_map.png": plots.capability_map(workspace, on_grid, limit_A),
        "capability_by_tilt.png": plots.capability_by_tilt(workspace, on_grid, by_tilt, limit_A),
    }
    for name, figure in drawn.items():
        plots.save(figure, folder / name)
    return [folder / name for name in drawn]


def _lost(worst_condition: Found) -> list[str]:
    """Whether the torque matrix loses a direction, and where first."""
    lost = np.flatnonzero(np.isinf(worst_condition.capability.condition))
    if not len(lost):
        return []
    first = worst_condition.at(lost[:1])
    direction = magnetic_tables.direction_text(first.capability.weak_direction[0].tolist())
    return [
        f"the torque matrix loses the direction ({direction}) at"
        f" {magnetic_tables.pose_text(np.degrees(first.q[0]).tolist())}, and at"
        f" {len(lost)} of {len(worst_condition.q)} tilts"
    ]


def _by_tilt(workspace: Workspace, on_grid: Capability, worst: dict[str, Found]) -> list[dict[str, float]]:
    reachable = workspace.reachable.any(axis=(1, 2))
    tilts = np.flatnonzero(reachable)
    least_norm, best, singular, condition = (
        worst[name].capability for name in ("least_norm", "best", "singular_value", "condition")
    )
    rows = []
    for row, tilt in enumerate(tilts):
        here = workspace.reachable[tilt]
        rows.append(
            {
                "tilt_deg": round(float(np.degrees(workspace.tilt_rad[tilt])), 9),
                "least_norm_Nm": float(least_norm.least_norm_Nm[row]),
                "least_norm_median_Nm": float(np.median(on_grid.least_norm_Nm[tilt][here])),
                "best_Nm": float(best.best_Nm[row]),
                "best_median_Nm": float(np.median(on_grid.best_Nm[tilt][here])),
                "singular_value_Nm_per_A": float(singular.singular_value_Nm_per_A[row]),
                "condition": float(condition.condition[row]),
                "copper_W_per_Nm2": float(singular.copper_W_per_Nm2[row]),
            }
        )
    return rows


def _told(name: str, found: Found, count: int) -> list[dict[str, Any]]:
    rows = []
    for i in range(min(count, len(found.q))):
        here = found.capability.at(i)
        direction = {
            "least_norm": here.least_norm_direction,
            "best": here.best_direction,
            "singular_value": here.weak_direction,
        }[name]
        tilt, azimuth, spin = np.degrees(found.tilt_azimuth_spin_rad[i]).tolist()
        rows.append(
            {
                "figure": name,
                "q_deg": np.degrees(found.q[i]).tolist(),
                "tilt_deg": tilt,
                "azimuth_deg": azimuth % 360,
                "spin_deg": spin,
                "direction": direction.tolist(),
                "least_norm_Nm": float(here.least_norm_Nm),
                "best_Nm": float(here.best_Nm),
                "singular_value_Nm_per_A": float(here.singular_value_Nm_per_A),
                "copper_W_per_Nm2": float(here.copper_W_per_Nm2),
            }
        )
    return rows


def _checks(workspace: Workspace, on_grid: Capability, weakest: Found, need: float | None) -> list[Check]:
    reached = on_grid.at(workspace.reachable)
    least_norm, best = reached.least_norm_Nm, reached.best_Nm
    checks = [
        Check(
            name="best_currents",
            compares="torque by least-norm currents over that by the best ones, two computations",
            states=len(best),
            value=float(np.max(least_norm[best > 0] / best[best > 0], initial=0.0)),
            bound=1.0 + ROUNDING,
            why="least-norm currents are among all currents; rounding is allowed for",
        )
    ]
    if need:
        available = float(weakest.capability.least_norm_Nm.min())
        checks.append(
            Check(
                name="need",
                compares=f"{need:g} N·m over the least-norm torque in the worst pose and direction",
                states=len(best),
                value=need / available if available else np.inf,
                bound=1.0,
                why="asked for by --need",
            )
        )
    return checks
