"""The parts of a recording, in the order in which a chunk is recorded: one row each."""

from spheretwin.viz.recording.parts.actuator import MovingActuator
from spheretwin.viz.recording.parts.log import Log
from spheretwin.viz.recording.parts.part import Part
from spheretwin.viz.recording.parts.scenario import ScenarioText
from spheretwin.viz.recording.parts.signals import Signals
from spheretwin.viz.recording.parts.states import States

PARTS: tuple[type[Part], ...] = (ScenarioText, Signals, MovingActuator, States, Log)
