"""Torque map: available torque in every direction over the workspace, its minimum, and a required torque."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check
from spheretwin.models.base.errors import InputError
from spheretwin.models.design import geometry_check
from spheretwin.models.design import workspace as workspaces
from spheretwin.models.design.capability import Capability, capability
from spheretwin.models.design.workspace import (
    FIGURES,
    LARGEST_TILT_DEG,
    Workspace,
    WorstPoses,
    local_minima,
    worst_by_tilt,
)

TILT_STEP_DEG = 1.0

# Number of weak poses reported for each figure.
REPORTED_POSES = {"least_norm": 3, "best": 1, "singular_value": 1}

ROUNDING = 1e-9


class TorqueSurvey(NamedTuple):
    """Data of the verdict and of the figures."""

    actuator: Actuator
    largest_tilt_deg: float
    workspace: Workspace
    on_grid: Capability
    """Capability at the poses of the workspace, in its shape."""
    worst: dict[str, WorstPoses]
    """Worst pose at each tilt, by the names of `FIGURES`."""
    weakest: dict[str, WorstPoses]
    """Worst poses of all, the worst first, by the names of `TOLD`."""


class TorqueAtTilt(NamedTuple):
    """Worst value and median over all poses at one tilt."""

    tilt_deg: float
    least_norm_Nm: float
    least_norm_median_Nm: float
    best_Nm: float
    best_median_Nm: float
    singular_value_Nm_per_A: float
    condition: float
    copper_W_per_Nm2: float


class WeakPose(NamedTuple):
    """Pose with the worst value of a figure."""

    figure: str
    q_deg: list[float]
    tilt_deg: float
    azimuth_deg: float
    spin_deg: float
    direction: list[float]
    """Of the least torque, stator frame."""
    least_norm_Nm: float
    best_Nm: float
    singular_value_Nm_per_A: float
    copper_W_per_Nm2: float


class WorkspaceVerdict(NamedTuple):
    """Torque over the workspace, with checks."""

    largest_tilt_deg: float
    poses: int
    """Number of poses within the ranges of the hinges."""
    current_limit_A: float
    by_tilt: list[TorqueAtTilt]
    weakest: list[WeakPose]
    checks: list[Check]
    warnings: list[str]


def survey(
    actuator: Actuator,
    largest_tilt_deg: float = LARGEST_TILT_DEG,
    track: Callable[[range], Iterable[int]] = iter,
) -> TorqueSurvey:
    """Compute the torque capability over the workspace, and search its minimum between the grid points.

    Parameters
    ----------
    actuator : Actuator
        Magnetics, current limit, resistance and hinge ranges.
    largest_tilt_deg : float, degrees
        Of the shaft.
    track : callable
        Iterates over the numbers of the blocks of poses, and may show progress.

    Raises
    ------
    InputError
        No pose is within the hinges' ranges.
    """
    workspace = workspaces.grid(actuator, largest_tilt_deg, TILT_STEP_DEG)
    if not workspace.reachable.any():
        raise InputError("workspace: expected hinge ranges that hold some pose, received none")
    flat = capability(workspace.q.reshape(-1, 3), actuator, track)
    on_grid = flat.reshaped(workspace.reachable.shape)
    worst = {name: worst_by_tilt(workspace, on_grid, figure, actuator) for name, figure in FIGURES.items()}
    weakest = {name: local_minima(workspace, worst[name], FIGURES[name], actuator) for name in REPORTED_POSES}
    return TorqueSurvey(actuator, largest_tilt_deg, workspace, on_grid, worst, weakest)


def judge(surveyed: TorqueSurvey, need_Nm: float | None = None) -> WorkspaceVerdict:
    """Report the torque by tilt and in the weakest poses, and compare it with a required torque.

    Parameters
    ----------
    surveyed : Survey
        Result of `survey`.
    need_Nm : float, N·m
        Torque that least-norm currents must give in every pose and direction, if given.
    """
    actuator = surveyed.actuator
    return WorkspaceVerdict(
        largest_tilt_deg=surveyed.largest_tilt_deg,
        poses=int(surveyed.workspace.reachable.sum()),
        current_limit_A=actuator.group.current_limit_A,
        by_tilt=_by_tilt(surveyed),
        weakest=[
            row
            for name, count in REPORTED_POSES.items()
            for row in _weak_poses(name, surveyed.weakest[name], count)
        ],
        checks=[_best_currents(surveyed), *([_need(surveyed, need_Nm)] if need_Nm else [])],
        warnings=[*geometry_check.of_geometry(actuator), *_lost(surveyed.worst["condition"])],
    )


def direction_text(direction: Sequence[float]) -> str:
    """Return the text of a unit vector."""
    return " ".join(f"{round(part, 2) + 0.0:.2f}" for part in direction)  # no negative zero


def _pose_text(q_deg: Sequence[float]) -> str:
    return ", ".join(f"{name} {round(angle, 1) + 0.0:.1f}°" for name, angle in zip("αβγ", q_deg, strict=True))


def _lost(worst_condition: WorstPoses) -> list[str]:
    """Return a warning if the torque matrix loses a direction, with the first pose."""
    lost = np.flatnonzero(np.isinf(worst_condition.capability.condition))
    if not len(lost):
        return []
    first = worst_condition.at(lost[0])
    direction = direction_text(first.capability.weak_direction.tolist())
    return [
        f"the torque matrix loses the direction ({direction}) at {_pose_text(np.degrees(first.q).tolist())},"
        f" and at {len(lost)} of {len(worst_condition.q)} tilts"
    ]


def _by_tilt(surveyed: TorqueSurvey) -> list[TorqueAtTilt]:
    workspace, on_grid = surveyed.workspace, surveyed.on_grid
    tilts = np.flatnonzero(workspace.reachable.any(axis=(1, 2)))
    least_norm, best, singular, condition = (
        surveyed.worst[name].capability for name in ("least_norm", "best", "singular_value", "condition")
    )
    rows = []
    for row, tilt in enumerate(tilts):
        here = workspace.reachable[tilt]
        rows.append(
            TorqueAtTilt(
                tilt_deg=round(float(np.degrees(workspace.tilt_rad[tilt])), 9),
                least_norm_Nm=float(least_norm.least_norm_Nm[row]),
                least_norm_median_Nm=float(np.median(on_grid.least_norm_Nm[tilt][here])),
                best_Nm=float(best.best_Nm[row]),
                best_median_Nm=float(np.median(on_grid.best_Nm[tilt][here])),
                singular_value_Nm_per_A=float(singular.singular_value_Nm_per_A[row]),
                condition=float(condition.condition[row]),
                copper_W_per_Nm2=float(singular.copper_W_per_Nm2[row]),
            )
        )
    return rows


def _weak_poses(name: str, worst: WorstPoses, count: int) -> list[WeakPose]:
    rows = []
    for i in range(min(count, len(worst.q))):
        here = worst.capability.at(i)
        direction = {
            "least_norm": here.least_norm_direction,
            "best": here.best_direction,
            "singular_value": here.weak_direction,
        }[name]
        tilt, azimuth, spin = np.degrees(worst.tilt_azimuth_spin_rad[i]).tolist()
        rows.append(
            WeakPose(
                figure=name,
                q_deg=np.degrees(worst.q[i]).tolist(),
                tilt_deg=tilt,
                azimuth_deg=azimuth % 360,
                spin_deg=spin,
                direction=direction.tolist(),
                least_norm_Nm=float(here.least_norm_Nm),
                best_Nm=float(here.best_Nm),
                singular_value_Nm_per_A=float(here.singular_value_Nm_per_A),
                copper_W_per_Nm2=float(here.copper_W_per_Nm2),
            )
        )
    return rows


def _best_currents(surveyed: TorqueSurvey) -> Check:
    reached = surveyed.on_grid.at(surveyed.workspace.reachable)
    least_norm, best = reached.least_norm_Nm, reached.best_Nm
    return Check(
        name="best_currents",
        compares="largest ratio of the torque by least-norm currents to that by the best currents at a pose",
        states=len(best),
        value=float(np.max(least_norm[best > 0] / best[best > 0], initial=0.0)),
        bound=1.0 + ROUNDING,
        why="least-norm currents within the limit are among those that the best are chosen of, by another"
        " computation; rounding is allowed for",
    )


def _need(surveyed: TorqueSurvey, need_Nm: float) -> Check:
    available = float(surveyed.weakest["least_norm"].capability.least_norm_Nm.min())
    return Check(
        name="need",
        compares=f"{need_Nm:g} N·m over the least-norm torque in the worst pose and direction",
        states=int(surveyed.workspace.reachable.sum()),
        value=need_Nm / available if available else np.inf,
        bound=1.0,
        why="required by --need",
    )
