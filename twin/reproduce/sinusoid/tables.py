"""Tables of figures 6 and 7: errors beside the printed ones, and what they cost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.twin.reproduce.experiment import Array, Outcome, Outcomes, Table
from spheretwin.twin.reproduce.laws import COMPARED, Compared
from spheretwin.twin.reproduce.printed import printed_rad
from spheretwin.twin.reproduce.rows import ended, figures_named, of_axis, spread, spread_mrad
from spheretwin.twin.reproduce.sinusoid.conditions import Condition, Varied, case

LARGEST = ("law", "how it ended", "printed, mrad", "α, mrad", "β, mrad", "γ, mrad", "in degrees")
RMS = (
    "law",
    "α, mrad",
    "β, mrad",
    "γ, mrad",
    "in degrees",
    "second half, mrad",
    "torque, N·m",
    "variation, A/s",
)
NONE = "–"


def tables(varied: Varied, outcomes: Outcomes) -> list[Table]:
    """Largest errors, then RMS errors and effort."""
    ran = [
        (condition, compared, outcomes[case(compared, condition).name])
        for condition in varied.conditions
        for compared in COMPARED
        if case(compared, condition).name in outcomes
    ]
    return [
        Table(
            "Largest |error|: median over the seeds, and range",
            (varied.symbol, *LARGEST),
            [(f"{varied.value(at):g}", *_largest(at, compared, found)) for at, compared, found in ran],
            4,
        ),
        Table(
            "RMS error, and what it costs: RMS torque, and variation of the commands a group and second",
            (varied.symbol, *RMS),
            [(f"{varied.value(at):g}", *rms(compared, found)) for at, compared, found in ran],
            2,
        ),
    ]


def _largest(condition: Condition, compared: Compared, found: Sequence[Outcome]) -> tuple[str, ...]:
    paper = printed_rad(compared.law, *condition)
    printed = NONE if paper is None else " / ".join(f"{1e3 * each:.1f}" for each in paper)
    return compared.label, ended(found), printed, *by_hinge(found, "max_abs_error")


def rms(compared: Compared, found: Sequence[Outcome]) -> tuple[str, ...]:
    """Row of RMS errors and effort."""
    tail = np.median([outcome.tail_rms_error for outcome in found], axis=0)
    return (
        compared.label,
        *by_hinge(found, "rms_error", 2),
        triple(1e3 * tail, 2),
        spread(figures_named(found, "rms_torque_Nm"), 3),
        spread(figures_named(found, "current_variation_A_s"), 1),
    )


def by_hinge(found: Sequence[Outcome], error: str, digits: int = 1) -> tuple[str, ...]:
    """An error of each hinge in mrad, then the medians of all three in degrees."""
    of_hinges = [of_axis(found, error, axis) for axis in range(3)]
    return *(spread_mrad(each, digits) for each in of_hinges), triple(
        np.degrees(np.median(of_hinges, axis=1)), 2
    )


def triple(values: Array, digits: int) -> str:
    """Numbers of α, β and γ."""
    return " / ".join(f"{value:.{digits}f}" if np.isfinite(value) else NONE for value in values)
