"""All views, in the order of their tabs: one row each."""

from __future__ import annotations

from collections.abc import Callable

import rerun.blueprint as rrb

from spheretwin.viz.layout.plots import Plots
from spheretwin.viz.layout.views.coils import coils
from spheretwin.viz.layout.views.compare import compare
from spheretwin.viz.layout.views.control import control
from spheretwin.viz.layout.views.hardware import hardware
from spheretwin.viz.layout.views.overview import overview
from spheretwin.viz.layout.views.scenario import scenario

VIEWS: dict[str, Callable[[Plots], rrb.Container | rrb.View]] = {
    "overview": overview,
    "control": control,
    "coils": coils,
    "hardware": hardware,
    "compare": compare,
    "scenario": scenario,
}
