"""Runs of one condition side by side on one timeline: a path a law, under the names of their laws."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.files import whole_file
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz import palette
from spheretwin.viz.layout.actuator_view import TRAIL_S
from spheretwin.viz.layout.paths import TIMELINE
from spheretwin.viz.scene.paths import WORLD
from spheretwin.viz.scene.poses import shaft_tip

Array = NDArray[np.float64]

DESIRED = "desired"


class Flight(NamedTuple):
    """One run."""

    law: str
    t_s: Array  # (n,)
    q_rad: Array  # (n, 3)
    q_ref_rad: Array  # (n, 3)
    torque_Nm: Array  # (n,) norm


def write(path: Path, flights: Mapping[str, Flight], actuator: Actuator, name: str) -> Path:
    """Write a recording of runs side by side; returns its path.

    Parameters
    ----------
    path : Path
    flights : mapping of label to Flight
        At least one.
    actuator : Actuator
        Whose shaft tip is drawn.
    name : str
        Of the recording.

    Raises
    ------
    InputError, SpheretwinError
        The file cannot be written there.
    """
    rr.set_strict_mode(True)
    digest = hashlib.sha256(repr((name, list(flights))).encode()).hexdigest()[:12]
    with whole_file(path) as temporary:
        recording = rr.RecordingStream(f"spheretwin-flights-{digest}")
        recording.set_log_time_enabled(False)
        recording.set_sinks(rr.FileSink(temporary), default_blueprint=_layout(flights))
        recording.send_recording_name(name)
        recording.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        longest = max(flights.values(), key=lambda flight: len(flight.t_s))
        _log_tip(
            recording, DESIRED, longest.t_s, shaft_tip(longest.q_ref_rad, actuator), palette.DESIRED_TRACE
        )
        colours = palette.law_colours([flight.law for flight in flights.values()])
        for label, flight in flights.items():
            _log_flight(recording, label, flight, actuator, _rgb(colours[flight.law]))
        recording.flush()
        recording.disconnect()
    return path


def _log_flight(
    recording: rr.RecordingStream, label: str, flight: Flight, actuator: Actuator, colour: palette.Colour
) -> None:
    _log_tip(recording, label, flight.t_s, shaft_tip(flight.q_rad, actuator), colour)
    error_mrad = 1e3 * (flight.q_rad - flight.q_ref_rad)
    for axis, angle in enumerate(ANGLES):
        _log_series(
            recording, f"error/{angle}/{_part(label)}", label, flight.t_s, error_mrad[:, axis], colour
        )
    _log_series(recording, f"torque/{_part(label)}", label, flight.t_s, flight.torque_Nm, colour)


def _log_tip(
    recording: rr.RecordingStream, label: str, t_s: Array, tips: Array, colour: palette.Colour
) -> None:
    """A point, and behind it a short segment an entry."""
    point, trail = f"{WORLD}/{_part(label)}/tip", f"{WORLD}/{_part(label)}/path"
    thick, thin = rr.Radius.ui_points(5.0), rr.Radius.ui_points(1.5)
    named = rr.Points3D.from_fields(labels=[label], colors=[colour], radii=thick)
    recording.log(point, named, static=True)
    recording.log(trail, rr.LineStrips3D.from_fields(colors=[colour], radii=thin), static=True)
    recording.send_columns(point, _index(t_s), rr.Points3D.columns(positions=tips))
    before = np.concatenate([tips[:1], tips[:-1]])
    strips = list(np.stack([before, tips], axis=1).astype(np.float32))
    recording.send_columns(trail, _index(t_s), rr.LineStrips3D.columns(strips=strips))


def _log_series(
    recording: rr.RecordingStream, entity: str, label: str, t_s: Array, values: Array, colour: palette.Colour
) -> None:
    recording.log(entity, rr.SeriesLines(names=[label], colors=[colour], widths=[1.5]), static=True)
    recording.send_columns(entity, _index(t_s), rr.Scalars.columns(scalars=values))


def _layout(flights: Mapping[str, Flight]) -> rrb.Blueprint:
    last_s = max(float(flight.t_s[-1]) for flight in flights.values())
    boundary = rrb.TimeRangeBoundary
    whole = rr.TimeRange(start=boundary.absolute(seconds=0), end=boundary.absolute(seconds=last_s))
    trail = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=boundary.cursor_relative(seconds=-TRAIL_S),
        end=boundary.cursor_relative(),
    )
    tips = rrb.Spatial3DView(
        origin=f"/{WORLD}",
        name="the shaft's tip under each law",
        background=list(palette.BACKGROUND),
        overrides={f"/{WORLD}/{_part(label)}/path": trail for label in (DESIRED, *flights)},
    )
    plots = [
        rrb.TimeSeriesView(origin=f"/{origin}", name=name, axis_x=rrb.TimeAxis(view_range=whole))
        for origin, name in (
            *((f"error/{angle}", f"error of {angle} [mrad]") for angle in ANGLES),
            ("torque", "torque of the coils, norm [N·m]"),
        )
    ]
    return rrb.Blueprint(
        rrb.Horizontal(tips, rrb.Vertical(*plots), column_shares=[4, 5]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _part(label: str) -> str:
    return rr.escape_entity_path_part(label.replace(" ", "_"))


def _rgb(colour: str) -> palette.Colour:
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def _index(t_s: Array) -> list[rr.TimeColumn]:
    nanoseconds = np.round(t_s * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn(TIMELINE, duration=nanoseconds)]
