"""What the law asks for, what comes of it, and in which state it is itself."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.viz.layout import panels
from spheretwin.viz.layout.plots import Plots, quantity, signal
from spheretwin.viz.quantities.coupling import COUPLING
from spheretwin.viz.quantities.delivered import DELIVERED
from spheretwin.viz.quantities.error import ERROR

SLIDING = "sliding_s"

LEAST = {"N·m": 0.01, "rad/s": 0.05, "rad": 0.02, "rad/s²": 0.5}
"""Half of the least range, by unit; other units have one of their own size."""


def control(plots: Plots) -> rrb.Container:
    """Errors and torques of each axis; below, what the law says of itself, and the coupling of the axes."""
    errors = [
        plots.about_zero(f"error {name}", "mrad", quantity(ERROR), least=ERROR.floor, axis=axis)
        for axis, name in enumerate(ANGLES)
    ]
    asked = [signal("torque_command_Nm"), quantity(DELIVERED), signal("disturbance_Nm")]
    torques = [
        plots.about_zero(
            f"torque {name}",
            "N·m",
            *asked,
            least=DELIVERED.floor,
            axis=axis,
            key=", grey load",
        )
        for axis, name in enumerate(ANGLES)
    ]
    return rrb.Grid(*errors, *torques, *_of_the_law(plots), grid_columns=3, name="control")


def _of_the_law(plots: Plots) -> list[rrb.Container | rrb.View]:
    own = {each.name: each for each in plots.view.own if _is_of_the_law(each)}
    coupling = plots.about_zero("coupling", "N·m", quantity(COUPLING), least=COUPLING.floor)
    sliding = []
    if SLIDING in own:
        del own[SLIDING]
        sliding = [
            plots.about_zero("sliding variables s", "rad/s", signal(SLIDING), least=LEAST["rad/s"]),
            panels.phase_plane(plots),
        ]
    units = dict.fromkeys(each.unit for each in own.values())
    tabs = [coupling, *(_plot(plots, unit, own) for unit in units)]
    return [*sliding, rrb.Tabs(*tabs, active_tab=0) if len(tabs) > 1 else coupling]


def _plot(plots: Plots, unit: str, own: dict[str, Signal]) -> rrb.TimeSeriesView:
    """Plot of all signals of one unit."""
    names = [name for name, each in own.items() if each.unit == unit]
    return plots.whole(", ".join(names), unit, *map(signal, names), least=LEAST.get(unit, 1e-3))


def _is_of_the_law(of: Signal) -> bool:
    """Whether a signal is one of those that laws log, and not of a stage around them."""
    return of.size <= len(ANGLES) and not of.states and of.name not in _AROUND


_AROUND = frozenset(
    {
        "q_measured_rad",
        "qdot_estimated_rad_s",
        "q_governed_rad",
        "qdot_governed_rad_s",
        "q_predicted_rad",
        "qdot_predicted_rad_s",
        "friction_Nm",
        "supply_power_W",
    }
)
"""Signals that stand in other views."""
