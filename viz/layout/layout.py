"""Layout of a run's recording: one view for each question about the run, each in a tab."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import rerun.blueprint as rrb

from spheretwin.viz.layout.extents import Extents
from spheretwin.viz.layout.plots import Plots
from spheretwin.viz.layout.view import TIMELINE, View
from spheretwin.viz.layout.views import VIEWS, run_line
from spheretwin.viz.rerun_internals import EncodedLayout

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
