"""The parts of a recording, in the order in which a chunk is recorded: one row each."""

from spheretwin.viz.recording.parts.drawn.currents import Currents
from spheretwin.viz.recording.parts.drawn.limits import Limits
from spheretwin.viz.recording.parts.drawn.phase_plane import PhasePlane
from spheretwin.viz.recording.parts.drawn.quantities import Quantities
from spheretwin.viz.recording.parts.log import Log
from spheretwin.viz.recording.parts.moving.actuator import MovingActuator
from spheretwin.viz.recording.parts.moving.ending import Ending
from spheretwin.viz.recording.parts.moving.torques import Torques
from spheretwin.viz.recording.parts.moving.traces import Traces
from spheretwin.viz.recording.parts.part import Part
from spheretwin.viz.recording.parts.scenario import ScenarioText
from spheretwin.viz.recording.parts.signals import Signals
from spheretwin.viz.recording.parts.states import States

PARTS: tuple[type[Part], ...] = (
    ScenarioText,
    Signals,
    MovingActuator,
    Traces,
    Torques,
    Ending,
    States,
    Limits,
    Log,
    Currents,
    PhasePlane,
    Quantities,  # the last: when a run has ended it sends the layout
)
