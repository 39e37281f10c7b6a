"""Layout of a run's recording: one view for each question about the run, each in a tab."""

from __future__ import annotations

from functools import lru_cache

import rerun as rr
import rerun.blueprint as rrb

from spheretwin.viz.layout import views
from spheretwin.viz.layout.extents import Extents
from spheretwin.viz.layout.plots import Plots
from spheretwin.viz.layout.view import TIMELINE, View
from spheretwin.viz.layout.views import VIEWS

# The run in a line takes two lines of text.
ROW_SHARES = (1, 10)


def layout(view: View, extents: Extents | None = None) -> rrb.Blueprint:
    """Blueprint of a run's recording.

    Parameters
    ----------
    view : View
        Properties of the run.
    extents : Extents, optional
        Extents of the run; ranges and titles follow from them.
    """
    plots = Plots(view, extents)
    tabs = [view_function(plots) for view_function in VIEWS.values()]
    return _blueprint(rrb.Tabs(*tabs, active_tab=list(VIEWS).index(view.shown), name="views"), view)


@lru_cache(maxsize=4)
def opening_layout(view: View) -> rrb.Blueprint:
    """Blueprint of a recording that is still written.

    One that is watched has every view. A file has the one that is shown: a layout takes room, and when the
    run has ended, the complete one with its ranges replaces it.
    """
    return layout(view) if view.live else _blueprint(VIEWS[view.shown](Plots(view, None)), view)


class _Small(rrb.Blueprint):
    """Blueprint without the clock's time in each of its rows, which is a quarter of its bytes."""

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        stream.set_log_time_enabled(False)
        super()._log_to_stream(stream)


def _blueprint(below: rrb.Container | rrb.View, view: View) -> rrb.Blueprint:
    return _Small(
        rrb.Vertical(views.run_line(), below, row_shares=ROW_SHARES),
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
