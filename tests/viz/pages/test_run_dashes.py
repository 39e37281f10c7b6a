"""Dashes of the runs in interactive plots: each its own, the same in the plot and on the switch."""

import re

from spheretwin.viz.pages import interactive
from tests.viz.comparison.compared import RAMP, VALUE, run_of

RUNS = [run_of((place + 1) * RAMP, label=f"{place + 1} run", law="pd") for place in range(8)]


def test_every_run_has_its_own_dash_in_the_plot_and_on_its_switch():
    figure = interactive.over_time(RUNS, [], [VALUE])
    lines = [trace for trace in figure.data if trace.type == "scatter" and trace.mode == "lines"]
    assert [trace.meta for trace in lines] == [str(place) for place in range(8)]
    dashes = [trace.line.dash for trace in lines]
    assert len(set(dashes)) == 8
    assert dashes[:2] == ["solid", "7.5px,1.5px"]
    switches = interactive._switches(RUNS)
    strokes = re.findall(r'stroke="([^"]*)" stroke-width="3" stroke-dasharray="([^"]*)"', switches)
    assert [colour for colour, _ in strokes] == [trace.line.color for trace in lines]
    assert [dash.replace(",", "px,") + "px" if dash else "solid" for _, dash in strokes] == dashes
