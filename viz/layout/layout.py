"""Layout of a run's recording: one view for each question about the run, each in a tab."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache, partial

import rerun.blueprint as rrb

from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.viz.layout.extents import Extents, PlotChannel
from spheretwin.viz.layout.plots import PlotLine, Plots, quantity, time_range
from spheretwin.viz.layout.view import (
    CURRENT_MAP,
    CURRENT_RMS,
    EVENTS,
    PHASE_PLANE,
    SCENARIO,
    SUMMARY,
    TIMELINE,
    View,
)
from spheretwin.viz.quantities import (
    COPPER_LOSS,
    COUPLING,
    DELIVERED,
    ERROR,
    ERROR_ANGLE,
    ESTIMATED_RATE,
    MARGIN,
    MEASURED_ANGLE,
    MOST,
    TIP_DISTANCE,
    Quantity,
)
from spheretwin.viz.rerun_internals import EncodedLayout
from spheretwin.viz.scene import meshes as scene
from spheretwin.viz.scene.entities import SCALE, TRACES

LEAST_rad, LEAST_rad_s = 0.02, 0.05

ANGLE_SIGNALS = ("q_rad", "q_ref_rad", "q_governed_rad", "q_predicted_rad", "q_measured_rad")
RATE_SIGNALS = (
    "qdot_rad_s",
    "qdot_ref_rad_s",
    "qdot_governed_rad_s",
    "qdot_predicted_rad_s",
    "qdot_estimated_rad_s",
)


AXIS_KEY = "●α ◆β ▲γ"
"""Markers of the hinges: no legend covers the lines."""

ROLES = {
    "q_measured_rad": "■ measured",
    "q_predicted_rad": "■ predicted",
    "q_governed_rad": "+ governed",
    "qdot_estimated_rad_s": "■ estimated (orange band)",
    "qdot_predicted_rad_s": "■ predicted (orange)",
    "qdot_governed_rad_s": "+ governed",
}
"""Markers of the lines of a hinge that not every run has: each has a name in the title of its plot."""


def compare(plots: Plots) -> rrb.Container:
    """Angles and rates of each axis with their references; below, the distance between the shaft's tips."""
    angles, rates = _lines(plots, ANGLE_SIGNALS), _lines(plots, RATE_SIGNALS)
    angles_of_each = [
        plots.whole(f"{name}: {_key(angles)}", "rad", *angles, least=LEAST_rad, axis=axis)
        for axis, name in enumerate(ANGLES)
    ]
    turning = plots.about_zero(f"rates, colours as above: {_key(rates)}", "rad/s", *rates, least=LEAST_rad_s)
    apart = plots.above_zero(
        "tip's distance from its reference", "mm", quantity(TIP_DISTANCE), least=TIP_DISTANCE.floor
    )
    above = rrb.Horizontal(*angles_of_each)
    return rrb.Vertical(above, turning, apart, row_shares=[4, 4, 3], name="compare")


def _key(lines: list[PlotLine]) -> str:
    """Return marker and name of each line."""
    return ", ".join(["● actual, × reference", *(ROLES[line.name] for line in lines if line.name in ROLES)])


def _lines(plots: Plots, names: tuple[str, ...]) -> list[PlotLine]:
    return [plots.signal(name) for name in names if name in plots.view.names]


def scenario(plots: Plots) -> rrb.View:
    """The resolved scenario as text."""
    return rrb.TextDocumentView(origin=f"/{SCENARIO}", name="scenario")


PHASE_TRAIL_S = 1.0


def run_line() -> rrb.TextDocumentView:
    """Name and state of the run in a line."""
    return rrb.TextDocumentView(origin=f"/{SUMMARY}", name="run", titlebar=False)


def current_maps(plots: Plots) -> tuple[rrb.TimeSeriesView, rrb.TimeSeriesView]:
    """Mean and RMS currents as colours: a row for each group, time along it.

    An alternating current vanishes in the mean.
    """
    return (
        plots.current_map(CURRENT_MAP, "mean currents", lambda ranges: f"±{ranges.mean_A:g} A"),
        plots.current_map(CURRENT_RMS, "RMS currents", lambda ranges: f"0 to {ranges.rms_A:g} A"),
    )


def current_bars(plots: Plots) -> rrb.BarChartView:
    """Currents of the row at the cursor, one bar a group."""
    return rrb.BarChartView(
        origin="/",
        contents=[f"/{scene.COILS}", f"/{scene.CURRENT_SCALE}"],
        name=f"currents at the cursor [A]; limit {plots.view.current_limit_A:g} A",
        plot_legend=rrb.PlotLegend(visible=False),
    )


def phase_plane(plots: Plots) -> rrb.Spatial2DView:
    """Rate of the error over what of the sliding variable is the error's, with its last second."""
    view = rrb.Spatial2DView(
        origin=f"/{PHASE_PLANE}",
        name="rad/s: phase plane, ė up, s - ė right; line s = 0",
        time_ranges=time_range(PHASE_TRAIL_S),
    )
    return plots.square(view, PlotChannel(SLIDING), least=0.1)


def log() -> rrb.TextLogView:
    """Log of events."""
    columns = rrb.TextLogColumns(text_log_columns=["loglevel", "body"])  # all have one path
    return rrb.TextLogView(origin=f"/{EVENTS}", name="events", columns=columns)


def coils(plots: Plots) -> rrb.Container:
    """Currents over time; below, those at the cursor, and the copper loss of all coils."""
    heat = plots.above_zero("heat of all coils", "W", quantity(COPPER_LOSS), least=COPPER_LOSS.floor)
    below = rrb.Horizontal(current_bars(plots), heat)
    return rrb.Vertical(*current_maps(plots), below, name="coils")


SLIDING = "sliding_s"

LEAST = {"N·m": 0.01, "rad/s": 0.05, "rad": 0.02, "rad/s²": 0.5}
"""Half of the least range, by unit; other units have one of their own size."""


def control(plots: Plots) -> rrb.Container:
    """Errors of the axes; below, torques of each, the signals of the law and the coupling of the axes."""
    lines = [plots.signal("torque_command_Nm"), quantity(DELIVERED), plots.signal("disturbance_Nm")]
    torques = [
        plots.about_zero(
            f"{name}: ●coils ×command +load",
            "N·m",
            *lines,
            least=DELIVERED.floor,
            axis=axis,
        )
        for axis, name in enumerate(ANGLES)
    ]
    rows = rrb.Horizontal(*torques), rrb.Horizontal(*_law_plots(plots))
    return rrb.Vertical(error_of_each_axis(plots), *rows, name="control")


def error_of_each_axis(plots: Plots) -> rrb.TimeSeriesView:
    """Tracking errors of the three hinges; the title is the key to all plots of the hinges."""
    return plots.about_zero(f"error of each axis: {AXIS_KEY}", "mrad", quantity(ERROR), least=ERROR.floor)


def _law_plots(plots: Plots) -> list[rrb.Container | rrb.View]:
    own = {own_signal.name: own_signal for own_signal in plots.view.own if _is_law_signal(own_signal)}
    coupling = plots.about_zero("coupling", "N·m", quantity(COUPLING), least=COUPLING.floor)
    sliding = []
    if SLIDING in own:
        del own[SLIDING]
        sliding = [
            plots.about_zero("sliding s", "rad/s", plots.signal(SLIDING), least=LEAST["rad/s"]),
            phase_plane(plots),
        ]
    units = dict.fromkeys(own_signal.unit for own_signal in own.values())
    tabs = [coupling, *(_plot(plots, unit, own) for unit in units)]
    return [*sliding, rrb.Tabs(*tabs, active_tab=0) if len(tabs) > 1 else coupling]


def _plot(plots: Plots, unit: str, own: dict[str, Signal]) -> rrb.TimeSeriesView:
    """Plot of all signals of one unit."""
    names = [name for name, own_signal in own.items() if own_signal.unit == unit]
    return plots.whole(", ".join(names), unit, *map(plots.signal, names), least=LEAST.get(unit, 1e-3))


def _is_law_signal(of: Signal) -> bool:
    """True if a signal is one that laws log, and not one of a stage around them."""
    return of.size <= len(ANGLES) and not of.states and of.name not in _OTHER_VIEWS


_OTHER_VIEWS = frozenset(
    {
        "q_measured_rad",
        "qdot_estimated_rad_s",
        "q_governed_rad",
        "qdot_governed_rad_s",
        "q_predicted_rad",
        "qdot_predicted_rad_s",
        "friction_Nm",
        "presliding_rad",
        "cable_Nm",
        "stator_temperature_degC",
        "rotor_temperature_degC",
        "supply_power_W",
    }
)
"""Signals that other views show."""


# Half of the least range of temperatures: the warming of a coil in a short run is negligible.
LEAST_degC = 5.0

# Half of a range of powers.
LEAST_W = 1.0


def hardware(plots: Plots) -> rrb.Container:
    """States and events next to the signals of sensors, amplifiers and coils."""

    def whole(title: str, unit: str, least: float, *names: str) -> rrb.TimeSeriesView:
        return plots.whole(title, unit, *map(plots.signal, names), least=least)

    def error(title: str, of: Quantity) -> rrb.TimeSeriesView:
        return plots.about_zero(f"{title}: {AXIS_KEY}", of.unit, quantity(of), least=of.floor)

    bodies = ("stator_temperature_degC", "rotor_temperature_degC")
    plots_by_signal: dict[str, Callable[[], rrb.TimeSeriesView]] = {
        "coil_temperature_degC": partial(
            whole, "coil temperature", "°C", LEAST_degC, "coil_temperature_degC"
        ),
        "voltage_limited": lambda: plots.fixed(
            "time at voltage limit [1]", plots.signal("voltage_limited"), low=-0.02, high=1.05
        ),
        "supply_power_W": partial(whole, "supply power", "W", LEAST_W, "supply_power_W"),
        "q_measured_rad": partial(error, "measured - true", MEASURED_ANGLE),
        "qdot_estimated_rad_s": partial(error, "estimated - true", ESTIMATED_RATE),
        "rotor_temperature_degC": partial(whole, "stator and rotor temperature", "°C", LEAST_degC, *bodies),
        "friction_Nm": partial(whole, "friction", "N·m", 0.002, "friction_Nm"),
        "presliding_rad": partial(
            whole, "elastic rotation in static friction", "rad", 1e-4, "presliding_rad"
        ),
        "cable_Nm": partial(whole, "cable", "N·m", 0.002, "cable_Nm"),
    }
    shown = [plot() for name, plot in plots_by_signal.items() if name in plots.view.names]
    state_views = [plots.states("states of the components"), log()]
    if not shown:
        return rrb.Vertical(*state_views, name="hardware")
    chain = rrb.Grid(*shown, grid_columns=2)
    return rrb.Horizontal(
        rrb.Vertical(*state_views, row_shares=[3, 2]), chain, column_shares=[1, 2], name="hardware"
    )


EYE_m, LOOKED_AT_m = (0.16, -0.16, 0.22), (0.0, 0.0, 0.012)


def eye(size: float) -> rrb.EyeControls3D:
    """Return the camera from which an actuator of a size, and its surroundings, are visible."""
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=[size * coordinate for coordinate in EYE_m],
        look_target=[size * coordinate for coordinate in LOOKED_AT_m],
        eye_up=[0, 0, 1],
    )


def actuator_view(size: float) -> rrb.Spatial3DView:
    """View of all that moves, and of the traces of the last seconds, on the ground of the viewer's theme."""
    return rrb.Spatial3DView(
        origin=f"/{scene.WORLD}",
        name=f"actuator; {SCALE}",
        line_grid=False,
        eye_controls=eye(size),
        overrides={f"/{trace.entity}": time_range(trace.oldest_s, trace.newest_s) for trace in TRACES},
    )


def overview(plots: Plots) -> rrb.Container:
    """Actuator and currents; next to them errors, torque margin, states and events."""
    maps = rrb.Tabs(*current_maps(plots), active_tab=0)
    left = rrb.Vertical(actuator_view(plots.view.size), maps, row_shares=[3, 2])
    # Next to each other: in a small window each then has the height for two numbers at its side.
    whole = rrb.Horizontal(
        plots.above_zero("error", "°", quantity(ERROR_ANGLE), least=ERROR_ANGLE.floor),
        plots.fixed("torque margin [1]", quantity(MARGIN), low=-0.05 * MOST, high=1.05 * MOST),
    )
    right = rrb.Vertical(
        whole,
        error_of_each_axis(plots),
        rrb.Horizontal(plots.states(), log()),
        row_shares=[10, 16, 12 if any(own_signal.states for own_signal in plots.view.own) else 10],
    )
    return rrb.Horizontal(left, right, column_shares=[4, 5], name="overview")


VIEWS: dict[str, Callable[[Plots], rrb.Container | rrb.View]] = {
    "overview": overview,
    "control": control,
    "coils": coils,
    "hardware": hardware,
    "compare": compare,
    "scenario": scenario,
}

# The headline and two lines.
ROW_SHARES = (1, 9)


def layout(view: View, extents: Extents | None = None) -> rrb.Blueprint:
    """Blueprint of a run's recording.

    Parameters
    ----------
    view : View
        Properties of the run.
    extents : Extents, optional
        Extents of the run; ranges and titles follow from them.
    """
    encoded, plots = _encoded(view._replace(run=""))
    return encoded.changed(plots.changes(extents)) if extents else encoded


def marked_lines(view: View) -> Mapping[tuple[str, ...], str]:
    """Return the entity of the markers by the signals and quantities whose lines share a plot."""
    return _encoded(view._replace(run=""))[1].marked


@lru_cache(maxsize=4)
def _encoded(view: View) -> tuple[EncodedLayout, Plots]:
    """Return the layout without extents, and its plots."""
    plots = Plots(view)
    tabs = [view_function(plots) for view_function in VIEWS.values()]
    active = list(VIEWS).index(view.shown)
    return _with_run_line(rrb.Tabs(*tabs, active_tab=active, name="views"), view), plots


def opening_layout(view: View) -> rrb.Blueprint:
    """Blueprint of a recording that is still written.

    One that is watched has every view. A file has the one that is shown: a layout takes room, and when the
    run has ended, the complete one with its ranges replaces it.
    """
    return layout(view) if view.live else _with_run_line(VIEWS[view.shown](Plots(view)), view)


def _with_run_line(below: rrb.Container | rrb.View, view: View) -> EncodedLayout:
    return blueprint(rrb.Vertical(run_line(), below, row_shares=ROW_SHARES), live=view.live)


def blueprint(contents: rrb.Container, *, live: bool = False) -> EncodedLayout:
    """Return the blueprint of a recording, which plays in a loop or follows a run."""
    return EncodedLayout(
        contents,
        rrb.TimePanel(
            state="collapsed",
            timeline=TIMELINE,
            play_state="following" if live else "playing",
            loop_mode="off" if live else "all",
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
    )
