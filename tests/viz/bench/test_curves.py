"""Curves of the bench: bands between the bounds of all ticks."""

import numpy as np

from spheretwin.viz import theme
from spheretwin.viz.bench.tabs import MOST_POINTS, CurvesPanel


class Plot:
    def __init__(self, **given):
        self.given, self.data, self.visible = given, given["data"], True


class Gui:
    def __init__(self):
        self.plots = []

    def add_uplot(self, **given):
        self.plots.append(Plot(**given))
        return self.plots[-1]


def test_curves_are_bands_between_the_bounds_of_every_part():
    gui = Gui()
    panel = CurvesPanel(gui)
    error, torque, _ = gui.plots
    count = 500
    t_s = 0.02 * np.arange(count)
    low = {"t_s": t_s, "error_rad": np.zeros((count, 3)), "torque_command_Nm": np.full((count, 3), -1.0)}
    high = {name: values.copy() for name, values in low.items()}
    high["error_rad"][123, 1], low["error_rad"][321, 2] = 0.004, -0.003  # of one part each
    high["torque_command_Nm"][:] = [1.0, 2.0, 3.0]
    panel.show(low, high)
    names = [series["label"] for series in error.given["series"]]
    assert names == ["s", "α min", "α max", "β min", "β max", "γ min", "γ max"]
    shown = dict(zip(names, error.data, strict=True))
    assert len(shown["s"]) <= MOST_POINTS
    assert (shown["β max"].max(), shown["γ min"].min()) == (4.0, -3.0)  # mrad
    assert shown["s"][shown["β max"].argmax()] <= t_s[123] < shown["s"][shown["β max"].argmax() + 1]
    for name in ("α min", "α max", "β min", "γ max"):
        assert not shown[name].any()
    torques = dict(zip(names, torque.data, strict=True))
    assert [torques[f"{axis} max"].max() for axis in "αβγ"] == [1.0, 2.0, 3.0]
    assert all(np.all(torques[f"{axis} min"] == -1.0) for axis in "αβγ")
    for plot in (error, torque):
        for band, axis, colour in zip(plot.given["bands"], "αβγ", theme.AXIS_COLOURS, strict=True):
            assert [names[place] for place in band["series"]] == [f"{axis} max", f"{axis} min"]
            assert band["fill"] == "rgba({},{},{},0.5)".format(*colour)
