"""Results of the magnetic model as tables, for the terminal and for pages, and the pages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from spheretwin.models.base.checks import bound_shares
from spheretwin.models.design.curve_check import ComputedCurve, CurvePeak, JudgedCurve, Misfit
from spheretwin.models.design.field_check import FieldVerdict
from spheretwin.models.design.torque_map import TorqueSurvey, WeakPose, WorkspaceVerdict, direction_text
from spheretwin.viz.pages import markdown
from spheretwin.viz.pages.markdown import Drawing, PageSection, ReportPage, ResultTable

# A table row for every third tilt: one screen.
ROW_STRIDE = 3

FIGURE_NAMES = {
    "least_norm": ("least-norm", "least_norm_Nm", "N·m"),
    "best": ("best", "best_Nm", "N·m"),
    "singular_value": ("least σ", "singular_value_Nm_per_A", "N·m/A"),
}

TITLES = {"check": "Check of the magnetic model", "map": "Torque capability over the workspace"}
CURVE_HEAD = ("figure", "value")
FIELD_HEAD = ("tilt", "poses", "median error", "largest", "of largest torque", "half the points")
# Two tables: in one, a terminal of 80 columns breaks the headings.
TORQUE_HEAD = ("tilt", "least-norm, worst", "least-norm, median", "best, worst", "best, median")
TORQUE_FORMATS = ("{:g}°", "{:.3f}", "{:.3f}", "{:.3f}", "{:.3f}")
MATRIX_HEAD = ("tilt", "least σ, N·m/A", "condition number", "copper loss, W/(N·m)²")
MATRIX_FORMATS = ("{:g}°", "{:.4f}", "{:.2f}", "{:.0f}")
POSE_HEAD = ("quantity", "worst", "tilt, °", "α, β, γ, °", "direction")

MAP_TERMS = (
    "least-norm: currents of least norm, those of the default allocation; best: the currents within the limit"
    " that give most torque, those of the bounded allocation. The torque is that of the worst direction."
    " σ: singular value of the torque matrix. Check best_currents: largest ratio of the least-norm torque to"
    " the best torque at a pose; a ratio above 1 is an error of the computation."
)
"""Meaning of the headings of the torque map."""


def computed_curve_table(computed: ComputedCurve) -> ResultTable:
    """Return the results for a computed curve."""
    title = "torque curve computed from the geometry"
    return ResultTable(title, CURVE_HEAD, [("peak", _peak(computed.peak))])


def judged_curve_table(path: Path, judged: JudgedCurve) -> ResultTable:
    """Return the results for a user's curve."""
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
    return ResultTable(f"torque curve {path}", CURVE_HEAD, rows)


def field_table(verdict: FieldVerdict) -> ResultTable:
    """Return the errors of the torque matrix by tilt."""
    title = f"torque by the curve against the direct sum (largest torque {verdict.largest_torque_Nm:.3f} N·m)"
    rows = [
        (f"{tilt_deg[0]:.0f}° to {tilt_deg[1]:.0f}°", str(poses), *map(_percent, errors))
        for tilt_deg, poses, *errors in verdict.by_tilt
    ]
    return ResultTable(title, FIELD_HEAD, rows)


def sources_text(verdict: FieldVerdict) -> str:
    """Return the sentence on the sources of the errors."""
    sources = verdict.sources
    return (
        "Sources of the error: the direct sum's quadrature"
        f" (half the points change it by {sources.quadrature_of_largest_torque:.0e} of the largest torque);"
        f" the curve between its samples ({sources.curve_between_samples_of_peak:.0e} of its peak);"
        f" the look-up table ({sources.lookup_of_peak:.0e} of the peak)."
    )


def workspace_tables(verdict: WorkspaceVerdict) -> list[ResultTable]:
    """Return torque by tilt, torque matrix by tilt, and the weakest poses."""
    tilts = [
        tilt for i, tilt in enumerate(verdict.by_tilt) if i % ROW_STRIDE == 0 or i == len(verdict.by_tilt) - 1
    ]
    torques = [_cells(TORQUE_FORMATS, tilt[:5]) for tilt in tilts]
    matrices = [_cells(MATRIX_FORMATS, (tilt.tilt_deg, *tilt[5:])) for tilt in tilts]
    title = (
        f"torque in every direction at {verdict.current_limit_A:g} A, N·m:"
        f" worst and median of {verdict.poses} poses"
    )
    return [
        ResultTable(title, TORQUE_HEAD, torques),
        ResultTable("torque matrix and copper loss in the worst of these poses", MATRIX_HEAD, matrices),
        ResultTable("weakest poses", POSE_HEAD, [_weak_row(pose) for pose in verdict.weakest]),
    ]


def write_check(folder: Path, verdict: FieldVerdict, command: str, figure_format: str) -> list[Path]:
    """Write the page of the comparison with direct sums and its figure; return both forms of the page.

    Parameters
    ----------
    folder : Path
        Exists.
    verdict : FieldVerdict
    command, figure_format : str
        As in `markdown.ReportPage`.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    from spheretwin.viz.figures import crosscheck  # Matplotlib is optional

    figure = crosscheck.margins(bound_shares(verdict.checks), "Share of the bound of each check")
    drawing = Drawing("magnetics_margins.svg", "Value over bound of each check.", figure)
    lead = (
        "Comparison of the torque matrix with the summed field of all magnets on all windings, in random"
        " poses and for random currents."
    )
    section = _section(field_table(verdict), sources_text(verdict))
    return _page("check", lead, verdict, [drawing], [section], command).write(folder, figure_format)


def write_map(
    folder: Path, surveyed: TorqueSurvey, verdict: WorkspaceVerdict, command: str, figure_format: str
) -> list[Path]:
    """Write the page of the torque map and its figures; return both forms of the page.

    Parameters
    ----------
    folder : Path
        Exists.
    surveyed : TorqueSurvey
    verdict : WorkspaceVerdict
        `torque_map.judge` of the survey.
    command, figure_format : str
        As in `markdown.ReportPage`.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    least_norm_Nm = min(pose.least_norm_Nm for pose in verdict.weakest)
    best_Nm = min(pose.best_Nm for pose in verdict.weakest)
    lead = (
        f"With at most {verdict.current_limit_A:g} A in each group, up to a tilt of"
        f" {verdict.largest_tilt_deg:g}°, least-norm currents give at least {least_norm_Nm:.3f} N·m in every"
        f" direction; the best currents give at least {best_Nm:.3f} N·m."
    )
    *tables, last = workspace_tables(verdict)
    sections = [*map(_section, tables), _section(last, MAP_TERMS)]
    return _page("map", lead, verdict, _maps(surveyed), sections, command).write(folder, figure_format)


def _maps(surveyed: TorqueSurvey) -> list[Drawing]:
    from spheretwin.viz.figures import maps  # Matplotlib is optional

    workspace, on_grid, worst = surveyed.workspace, surveyed.on_grid, surveyed.worst
    limit_A = surveyed.actuator.group.current_limit_A
    by_tilt = {
        "least_norm_Nm": worst["least_norm"].capability.least_norm_Nm,
        "best_Nm": worst["best"].capability.best_Nm,
        "copper_W_per_Nm2": worst["singular_value"].capability.copper_W_per_Nm2,
    }
    return [
        Drawing(
            "capability_by_tilt.svg",
            "Torque that is available in every direction, and copper loss, against the tilt of the shaft.",
            maps.capability_by_tilt(workspace, on_grid, by_tilt, limit_A),
        ),
        Drawing(
            "capability_map.svg",
            "Worst value over all directions of torque and all spins; radius: tilt of the shaft in degrees,"
            " angle: its azimuth.",
            maps.capability_map(workspace, on_grid, limit_A),
        ),
    ]


def _page(
    part: str, lead: str, verdict: FieldVerdict | WorkspaceVerdict, drawings: Sequence[Drawing],
    sections: Sequence[PageSection], command: str,
) -> ReportPage:  # fmt: skip
    """Page of a part: warnings and exceeded bounds are in its summary."""
    warnings = [f"Warning: {warning}." for warning in verdict.warnings]
    summary = " ".join([lead, markdown.verdict(verdict.checks), *warnings])
    sections = [
        *markdown.figures_section(drawings), *sections, markdown.checks_section(verdict.checks)
    ]  # fmt: skip
    return ReportPage(f"magnetics_{part}", TITLES[part], summary, sections, command)


def _section(table: ResultTable, text: str = "") -> PageSection:
    """Section that has the title of its table."""
    return PageSection(f"{table.title[0].upper()}{table.title[1:]}", [table._replace(title=""), text])


def _weak_row(pose: WeakPose) -> tuple[str, ...]:
    name, key, unit = FIGURE_NAMES[pose.figure]
    angles = " ".join(map(_tenths, pose.q_deg))
    worst = f"{getattr(pose, key):.3g} {unit}"
    return name, worst, _tenths(pose.tilt_deg), angles, direction_text(pose.direction)


def _cells(forms: Sequence[str], values: Sequence[float]) -> list[str]:
    return [form.format(value) for form, value in zip(forms, values, strict=True)]


def _peak(peak: CurvePeak) -> str:
    return f"{peak.peak_Nm_per_A:.5f} N·m/A at {peak.peak_deg:.2f}°"


def _misfit(misfit: Misfit, unit: str) -> str:
    rms, worst = 100 * misfit.rms, 100 * misfit.worst
    return f"rms {rms:.2g} %, at most {worst:.2g} % of {unit} (at {misfit.worst_deg:.2f}°)"


def _tenths(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f}"  # no negative zero


def _percent(share: float) -> str:
    return f"{100 * share:.3f} %"
