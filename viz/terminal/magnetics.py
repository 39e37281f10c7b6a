"""The magnetic model's verdicts as tables for people, on stdout."""

from __future__ import annotations

from pathlib import Path

from spheretwin.models.design.curve_check import ComputedCurve, CurvePeak, JudgedCurve, Misfit
from spheretwin.models.design.field_check import FieldVerdict
from spheretwin.models.design.torque_map import WeakPose, WorkspaceVerdict, direction_text
from spheretwin.viz.terminal import tables
from spheretwin.viz.terminal.runs import print_rows

# A table row for every third tilt: one screen.
ROW_STRIDE = 3

FIGURE_NAMES = {
    "least_norm": ("least norm", "least_norm_Nm", "N·m"),
    "best": ("best", "best_Nm", "N·m"),
    "singular_value": ("least σ", "singular_value_Nm_per_A", "N·m/A"),
}


CURVE_HEAD = ("figure", "value")
TILT_HEAD = (
    "tilt", "least norm", "median of it", "best currents", "median of it", "least σ, N·m/A", "cond.",
    "copper, W/(N·m)²",
)  # fmt: skip
POSE_HEAD = ("by", "worst", "tilt, °", "α, °", "β, °", "γ, °", "direction")


def print_computed_curve(computed: ComputedCurve) -> None:
    """Print the results for a computed curve."""
    print_rows("torque curve computed from the geometry", CURVE_HEAD, [("peak", _peak(computed.peak))], 1)


def print_judged_curve(path: Path, judged: JudgedCurve) -> None:
    """Print the results for a user's curve."""
    geometry = judged.geometry
    rows = [
        ("samples", str(judged.rows)),
        ("peak", _peak(judged.peak)),
        ("leave-one-out error of a sample", _misfit(judged.leave_one_out, "peak")),
        ("difference from the geometry's curve", _misfit(geometry.as_given, "its peak")),
        ("best factor on the geometry's curve", f"{geometry.scale:.4f}"),
        ("difference from it after scaling", _misfit(geometry.scaled, "its peak")),
        ("difference of look-up table and spline", f"{judged.lookup_error:.1e} of the peak"),
    ]
    print_rows(f"torque curve {path}", CURVE_HEAD, rows, 1)


def print_field(verdict: FieldVerdict) -> None:
    """Print the errors of the torque matrix by tilt, and their sources."""
    console = tables.terminal_console()
    title = f"torque by the curve against the direct sum (largest torque {verdict.largest_torque_Nm:.3f} N·m)"
    head = ("tilt", "poses", "median error", "largest", "of largest torque", "half the points")
    rows = [
        (
            f"{band.tilt_deg[0]:.0f}° to {band.tilt_deg[1]:.0f}°",
            str(band.poses),
            _percent(band.median_relative_error),
            _percent(band.largest_relative_error),
            _percent(band.largest_error_of_largest_torque),
            _percent(band.quadrature_of_largest_torque),
        )
        for band in verdict.by_tilt
    ]
    print_rows(title, head, rows, 1)
    sources = verdict.sources
    console.print(
        "Sources of the error: the direct sum's quadrature"
        f" (half the points change it by {sources.quadrature_of_largest_torque:.0e} of the largest torque);"
        f" the curve between its samples ({sources.curve_between_samples_of_peak:.0e} of its peak);"
        f" the look-up table ({sources.lookup_of_peak:.0e} of the peak)."
    )


def print_workspace(verdict: WorkspaceVerdict) -> None:
    """Print the torque capability by tilt, and the weakest poses."""
    rows = [
        (
            f"{tilt.tilt_deg:g}°",
            f"{tilt.least_norm_Nm:.3f}",
            f"{tilt.least_norm_median_Nm:.3f}",
            f"{tilt.best_Nm:.3f}",
            f"{tilt.best_median_Nm:.3f}",
            f"{tilt.singular_value_Nm_per_A:.4f}",
            f"{tilt.condition:.2f}",
            f"{tilt.copper_W_per_Nm2:.0f}",
        )
        for i, tilt in enumerate(verdict.by_tilt)
        if i % ROW_STRIDE == 0 or i == len(verdict.by_tilt) - 1
    ]
    title = (
        f"torque in every direction at {verdict.current_limit_A:g} A, N·m:"
        f" worst and median of {verdict.poses} poses"
    )
    print_rows(title, TILT_HEAD, rows, 1)
    print_rows("weakest poses", POSE_HEAD, [_weak_row(pose) for pose in verdict.weakest], 1)


def _weak_row(pose: WeakPose) -> tuple[str, ...]:
    name, key, unit = FIGURE_NAMES[pose.figure]
    angles = (_tenths(angle) for angle in (pose.tilt_deg, *pose.q_deg))
    return name, f"{getattr(pose, key):.3g} {unit}", *angles, direction_text(pose.direction)


def _peak(peak: CurvePeak) -> str:
    return f"{peak.peak_Nm_per_A:.5f} N·m/A at {peak.peak_deg:.2f}°"


def _misfit(misfit: Misfit, unit: str) -> str:
    rms, worst = 100 * misfit.rms, 100 * misfit.worst
    return f"rms {rms:.2g} %, at most {worst:.2g} % of {unit} (at {misfit.worst_deg:.2f}°)"


def _tenths(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f}"  # no negative zero


def _percent(share: float) -> str:
    return f"{100 * share:.3f} %"
