"""Curves of the last seconds: error, torque, temperature."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from spheretwin.viz import palette

HEIGHT = 125

# Points of a curve: what a narrow panel can show.
MOST_POINTS = 150

_INK, _LINES = "#adb5bd", "#343a40"


class Plots:
    """Curves that follow the bench.

    Parameters
    ----------
    gui : viser.GuiApi
        In the container they are to be in.
    """

    def __init__(self, gui: viser.GuiApi) -> None:
        self._error = _plot(gui, "error, mrad", ("α", "β", "γ"))
        self._torque = _plot(gui, "torque asked for, N·m", ("α", "β", "γ"))
        self._temperature = _plot(gui, "warmest winding, °C", ("T",))
        self._temperature.visible = False
        self._warmest: deque[tuple[float, float]] = deque(maxlen=MOST_POINTS)

    def warm(self, t_s: float, temperature_C: tuple[float, ...] | None) -> None:
        """Draw the warmest winding, where the hardware has any that warm."""
        if temperature_C is None:
            self._temperature.visible = False
            return
        if self._warmest and t_s <= self._warmest[-1][0]:  # another run
            self._warmest.clear()
        self._warmest.append((t_s, max(temperature_C)))
        if len(self._warmest) > 1:
            self._temperature.data = tuple(np.array(self._warmest).T.copy())
            self._temperature.visible = True

    def show(self, rows: dict[str, NDArray[np.float64]]) -> None:
        """Draw rows, as a bench's history has them."""
        if not rows or len(rows["t_s"]) < 2:
            return
        stride = -(-len(rows["t_s"]) // MOST_POINTS)
        t_s = rows["t_s"][::-stride][::-1]
        for plot, values in (
            (self._error, 1e3 * rows["error_rad"]),
            (self._torque, rows["torque_command_Nm"]),
        ):
            plot.data = (t_s, *(np.ascontiguousarray(column[::-stride][::-1]) for column in values.T))


def _plot(gui: viser.GuiApi, title: str, names: tuple[str, ...]) -> viser.GuiUplotHandle:
    nothing = np.array([0.0, 1.0])
    colours = ["rgb({},{},{})".format(*colour) for colour in palette.AXIS_COLOURS[: len(names)]]
    curves: Any = tuple(
        {"label": name, "stroke": colour, "width": 1.5, "points": {"show": False}}
        for name, colour in zip(names, colours, strict=True)
    )
    axis = {
        "stroke": _INK,
        "grid": {"stroke": _LINES, "width": 1},
        "ticks": {"stroke": _LINES},
        "font": "10px sans-serif",
    }
    axes: Any = tuple({**axis, "size": size} for size in (32, 44))
    return gui.add_uplot(
        data=(nothing, *(np.zeros(2) for _ in names)),
        series=({"label": "s"}, *curves),
        title=title,
        scales={"x": {"time": False}},
        axes=axes,
        legend={"show": True, "live": False},
        cursor={"show": False},
        height=HEIGHT,
        padding=(2, 8, 0, 0),
    )
