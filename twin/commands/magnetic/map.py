"""``spheretwin magnetics map``: the torque available in every direction, over the workspace."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType

from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import make_folder
from spheretwin.models.design import workspace_verdict
from spheretwin.models.design.workspace_verdict import Survey
from spheretwin.twin.commands.reporting import kept, print_json, warn, warn_of_model
from spheretwin.viz.terminal import magnetic_tables, tables
from spheretwin.viz.terminal.checks import print_checks
from spheretwin.viz.terminal.progress import tracked


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
    surveyed = workspace_verdict.survey(actuator, options.largest_tilt, tracked("torque capability"))
    verdict = workspace_verdict.judge(surveyed, options.need)
    warn_of_model(options.mjcf)
    warn(verdict.warnings)
    files = _draw(plots, options.out, surveyed) if plots else []
    if options.json:
        print_json({**verdict._asdict(), "figures": [str(path) for path in files]})
    else:
        magnetic_tables.print_workspace(verdict)
        print_checks("magnetics map", verdict.checks, options.verbose)
        tables.print_written(files)
    return kept("magnetics map", verdict.checks)


def _plots() -> ModuleType:
    try:
        return import_module("spheretwin.viz.figures.magnetic_plots")
    except ModuleNotFoundError as error:
        raise InputError(
            "magnetics map: expected the extra `spheretwin[plots]` to draw figures,"
            f" received an installation without {error.name}"
        ) from None


def _draw(plots: ModuleType, folder: Path, surveyed: Survey) -> list[Path]:
    from spheretwin.viz.figures.plots import save  # Matplotlib is optional

    workspace, on_grid, worst = surveyed.workspace, surveyed.on_grid, surveyed.worst
    limit_A = surveyed.actuator.group.current_limit_A
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
        save(figure, folder / name)
    return [folder / name for name in drawn]
