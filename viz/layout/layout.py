"""How a recording is laid out: the actuator and its currents beside the plots of a controller's day."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from spheretwin.viz.layout.actuator_view import actuator_view
from spheretwin.viz.layout.paths import EVENTS, SCENARIO, STATES, TELEMETRY, TIMELINE, entity
from spheretwin.viz.layout.view import View


@lru_cache(maxsize=4)
def layout(view: View) -> rrb.Blueprint:
    """Blueprint of a run's recording."""
    boundary = rrb.TimeRangeBoundary
    whole = rr.TimeRange(start=boundary.absolute(seconds=0), end=boundary.absolute(seconds=view.duration_s))
    time = rrb.TimeAxis(view_range=whole)

    def plot(name: str, *signals: str, legend: bool = True, **options: Any) -> rrb.TimeSeriesView:
        contents = [f"/{entity(signal)}" for signal in signals]
        corner = rrb.PlotLegend(rrb.Corner2D.RightTop, visible=legend)
        return rrb.TimeSeriesView(
            origin=f"/{TELEMETRY}", contents=contents, name=name, axis_x=time, plot_legend=corner, **options
        )

    def only(signals: tuple[str, ...], visible: list[bool]) -> dict[str, Any]:
        series = rr.SeriesLines.from_fields(visible_series=visible)
        return {f"/{entity(signal)}": series for signal in signals}

    angles = ("q_ref_rad", "q_rad")
    limit_A = 1.05 * view.current_limit_A
    limits = rrb.ScalarAxis(range=(-limit_A, limit_A))
    title = f"currents of the {view.groups} groups [A]"
    currents = plot(title, "current_A", legend=False, axis_y=limits)
    tilt, spin = only(angles, [True, True, False]), only(angles, [False, False, True])
    whole_share = rrb.ScalarAxis(range=(0, 1.05))
    torques = plot("generalised torque [N·m]", "torque_command_Nm", "disturbance_Nm")
    slides = "sliding_s" in {signal.name for signal in view.own}
    demand = plot("sliding variable s [rad/s]", "sliding_s") if slides else torques
    tabs = [
        plot(f"{signal.name} [{signal.unit}]", signal.name)
        for signal in view.own
        if signal.name != "sliding_s" and not signal.states
    ]
    may_fail = any(signal.states for signal in view.own)
    plots = rrb.Grid(
        plot("tilt α red, β green, desired muted [rad]", *angles, legend=False, overrides=tilt),
        plot("tracking error [rad]", "error_rad"),
        plot("spin γ, desired muted [rad]", *angles, legend=False, overrides=spin),
        demand,
        plot("torque of the coils, stator frame [N·m]", "torque_Nm"),
        plot("share of the commanded torque [1]", "allocation_scale", legend=False, axis_y=whole_share),
        grid_columns=2,
    )
    texts = rrb.Tabs(
        rrb.TextDocumentView(origin=f"/{SCENARIO}", name="scenario"),
        rrb.TextLogView(origin=f"/{EVENTS}", name="events"),
        *([rrb.StateTimelineView(origin=f"/{STATES}", name="states", time_view=time)] if may_fail else []),
        *([torques] if slides else []),
        *tabs,
        active_tab="states" if any(signal.name == "fault" for signal in view.own) else "scenario",
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(actuator_view(), currents, row_shares=[3, 1]),
            rrb.Vertical(plots, texts, row_shares=[3, 1]),
            column_shares=[4, 5],
        ),
        rrb.TimePanel(
            state="collapsed",
            timeline=TIMELINE,
            play_state="following" if view.live else "playing",
            loop_mode="off" if view.live else "all",
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )
