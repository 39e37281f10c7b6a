"""What is kept of a run: when it reached its reference, what it spent early and late, how V went."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spheretwin.models.telemetry.table import Table
from spheretwin.twin.reproduce.stability.conditions import LONG_s
from spheretwin.twin.reproduce.stability.descent import Descent, descent
from spheretwin.twin.simulation import Run

REACHED_rad_s, SLOPE = 0.05, 50.0
"""Of |λe + ė|, and λ in 1/s: an error of 1 mrad that stays."""

SPAN_s = 60.0


class Span(NamedTuple):
    """A minute of a long run."""

    rms_error_rad: float
    rms_torque_Nm: float
    variation_A_s: float
    at_limit: float
    """Share of the ticks."""


class Kept(NamedTuple):
    """What remains of a run."""

    reached_s: float | None
    """First time at which |λe + ė| of every hinge is below `REACHED_rad_s`; None if never."""
    early: Span | None
    late: Span | None
    """First and last minute; None of shorter runs."""
    gains: tuple[float, float] | None
    """Largest ξ̂ and ζ̂ at the end; None of laws that have none."""
    descent: Descent | None


def keep(run: Run) -> Kept:
    """Reduce a run."""
    table, period_s = run.telemetry, run.scenario.controller.period_s
    ticks = round(SPAN_s / period_s)
    is_long = run.scenario.duration >= LONG_s and len(table) >= 2 * ticks
    surface = SLOPE * table["error_rad"] + table["qdot_rad_s"] - table["qdot_ref_rad_s"]
    inside = np.flatnonzero(np.all(np.abs(surface) < REACHED_rad_s, axis=1))
    named = {signal.name for signal in table.signals}
    has_gains = {"switching_gain", "bound_gain"} <= named and len(table) > 0
    return Kept(
        reached_s=float(table["t_s"][inside[0]]) if len(inside) else None,
        early=_span(table, slice(0, ticks), period_s) if is_long else None,
        late=_span(table, slice(len(table) - ticks, None), period_s) if is_long else None,
        gains=(float(table["switching_gain"][-1].max()), float(table["bound_gain"][-1].max()))
        if has_gains
        else None,
        descent=None if is_long else descent(run),
    )


def _span(table: Table, ticks: slice, period_s: float) -> Span:
    commands = table["current_command_A"][ticks]
    return Span(
        rms_error_rad=float(np.sqrt(np.mean(table["error_rad"][ticks] ** 2, axis=0)).max()),
        rms_torque_Nm=float(np.sqrt(np.mean(np.sum(table["torque_Nm"][ticks] ** 2, axis=1)))),
        variation_A_s=float(
            np.abs(np.diff(commands, axis=0)).sum(axis=0).mean() / (len(commands) * period_s)
        ),
        at_limit=float(np.mean(table["allocation_scale"][ticks] < 1)),
    )
