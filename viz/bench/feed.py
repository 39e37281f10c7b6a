"""Feed of the page's own script: status, plots and coils as one binary message.

A message is the length of its header (4 bytes, little-endian), the header as JSON, spaces up to a multiple
of 8 bytes, and columns of numbers as 8-byte floats: the numbers and the times of the bins, then the least and
the greatest values of each plotted column.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.viz import theme
from spheretwin.viz.bench.protocols import BenchProtocol

DATA, CAPTURE = "/bench.data", "/capture.data"

VECTORS = (("q", "q_rad", 180 / np.pi), ("ref", "q_ref_rad", 180 / np.pi), ("error", "error_rad", 1e3))
"""Plotted columns of each axis: key, signal, factor to the unit of the plot."""

MOST_SELECTED = 6


class Feed:
    """Feed of the pages of one bench.

    Parameters
    ----------
    bench : BenchProtocol
    header : callable
        Entries of the header besides those of the plots: the status of the page.
    """

    def __init__(self, bench: BenchProtocol, header: Callable[[], dict[str, Any]]) -> None:
        self._bench, self._header = bench, header

    @property
    def answers(self) -> dict[str, Callable[[Mapping[str, str]], bytes]]:
        """Functions that answer the requests of the script, by path; each takes the query."""
        return {DATA: self.data, CAPTURE: self.capture}

    def data(self, query: Mapping[str, str]) -> bytes:
        """Return the status, and the bins since those that a page has."""
        run, after = _number(query.get("run")), _number(query.get("after"))
        bins = self._bench.bins(after)
        header = self._header()
        if bins.run != run:  # the page has bins of another run
            bins = self._bench.bins()
            header |= fixed(self._bench.actuator)
        columns = plotted(bins.low, bins.high, _groups(query))
        header |= {"run": bins.run, "count": len(bins.numbers), "columns": list(columns)}
        numbers = np.array(bins.numbers, dtype=float)
        return message(header, [numbers, bins.low["t_s"].reshape(-1), *_flat(columns)])

    def capture(self, query: Mapping[str, str]) -> bytes:
        """Return every row of the completed capture."""
        rows = self._bench.captured()
        if not rows:
            return message({"count": 0, "columns": []}, [])
        columns = plotted(rows, rows, _groups(query))
        t_s = rows["t_s"].reshape(-1)
        header = {"count": len(t_s), "columns": list(columns), "event_s": self._bench.state().capture_t_s}
        return message(header, [np.arange(len(t_s), dtype=float), t_s, *_flat(columns)])


def plotted(
    low: Mapping[str, Array], high: Mapping[str, Array], groups: list[int]
) -> dict[str, tuple[Array, Array]]:
    """Return the bounds of the plotted columns, in the units of the plots."""
    columns = {}
    for key, signal, factor in (*VECTORS, ("torque", "torque_command_Nm", 1.0)):
        for axis in range(3):
            columns[f"{key}{axis}"] = factor * low[signal][:, axis], factor * high[signal][:, axis]
    least, most = low["current_A"], high["current_A"]
    columns["currents"] = least.min(axis=1), most.max(axis=1)
    for group in groups:
        if group < least.shape[1]:
            columns[f"current{group}"] = least[:, group], most[:, group]
    temperature = "coil_temperature_degC"
    columns["temperature"] = low[temperature].max(axis=1), high[temperature].max(axis=1)
    return columns


def fixed(actuator: Actuator) -> dict[str, Any]:
    """Return what does not change in a run: the coils in metres, their groups, and the colours."""
    end = actuator.coil.distance_m + actuator.coil.length_m / 2
    return {
        "fixed": {
            "coils": (end * actuator.coil_axes).tolist(),
            "radius": actuator.coil.outer_radius_m,
            "ball": actuator.magnet.front_m,
            "groups": actuator.groups.tolist(),
            "axes": [_css(colour) for colour in theme.AXIS_COLOURS],
            "desired": _css(theme.COMMAND),
            "plain": _css(theme.ESTIMATE),
            "failed": _css(theme.FAILURE),
            "selected": list(theme.LAW_COLOURS.values())[:MOST_SELECTED],
        }
    }


def message(header: Mapping[str, Any], columns: list[Array]) -> bytes:
    """Return a message of the feed."""
    text = json.dumps(header).encode()
    text += b" " * (-(4 + len(text)) % 8)
    numbers = b"".join(np.ascontiguousarray(column, dtype="<f8").tobytes() for column in columns)
    return len(text).to_bytes(4, "little") + text + numbers


def _flat(columns: Mapping[str, tuple[Array, Array]]) -> list[Array]:
    return [bound for bounds in columns.values() for bound in bounds]


def _groups(query: Mapping[str, str]) -> list[int]:
    """Return the selected groups of a query."""
    groups = map(_number, query.get("groups", "").split(",")[:MOST_SELECTED])
    return sorted({group for group in groups if group >= 0})


def _number(text: str | None) -> int:
    return int(text) if text and text.isascii() and text.isdecimal() and len(text) < 12 else -1


def _css(colour: theme.Colour) -> str:
    return "rgb({},{},{})".format(*colour)
