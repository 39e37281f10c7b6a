"""A channel of the converter of commands: held, shifted, scaled, noisy, or at 0 V."""

from spheretwin.twin.faults import lines
from spheretwin.twin.faults.target import Target

SOURCE = 0
"""Of noise."""

TARGET = Target(
    "dac", lines.modes(SOURCE, "V", lambda effects: effects.transconductance_A_V), each_group=True
)
