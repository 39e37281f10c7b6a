"""What the parts between law and rotor do, and which of them fails."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.viz.layout import panels
from spheretwin.viz.layout.plots import Plots, quantity, signal
from spheretwin.viz.quantities.estimated_rate import ESTIMATED_RATE
from spheretwin.viz.quantities.measured_angle import MEASURED_ANGLE

# Half of a range of temperatures: what a coil warms by in a short run is nothing yet.
LEAST_degC = 5.0

# Half of a range of powers.
LEAST_W = 1.0


def hardware(plots: Plots) -> rrb.Container:
    """States and events beside what the chain of sensors, amplifiers and coils shows of itself."""
    names = plots.view.names
    shown = []
    if "coil_temperature_degC" in names:
        line = signal("coil_temperature_degC")
        shown.append(plots.whole("temperature of the coils", "°C", line, least=LEAST_degC))
    if "voltage_limited" in names:
        title = "share of time with the voltage at its limit"
        shown.append(plots.fixed(title, signal("voltage_limited"), low=-0.02, high=1.05))
    if "supply_power_W" in names:
        line = signal("supply_power_W")
        shown.append(plots.whole("power of the supply", "W", line, least=LEAST_W))
    if "q_measured_rad" in names:
        title = "measured - true"
        shown.append(plots.about_zero(title, "mrad", quantity(MEASURED_ANGLE), least=MEASURED_ANGLE.floor))
        title = "estimated - true"
        shown.append(plots.about_zero(title, "rad/s", quantity(ESTIMATED_RATE), least=ESTIMATED_RATE.floor))
    if "friction_Nm" in names:
        shown.append(plots.whole("friction", "N·m", signal("friction_Nm"), least=0.002))
    told = [plots.states("states of what can fail"), panels.log()]
    if not shown:
        return rrb.Vertical(*told, name="hardware")
    chain = rrb.Grid(*shown, grid_columns=2)
    return rrb.Horizontal(
        rrb.Vertical(*told, row_shares=[3, 2]), chain, column_shares=[2, 3], name="hardware"
    )
