"""A channel of the converter of commands: held, shifted, scaled, noisy, or at 0 V."""

from spheretwin.twin.faults import line_modes
from spheretwin.twin.faults.line_modes import Signal
from spheretwin.twin.faults.target import Target

SIGNAL = Signal(
    lambda effects: effects.drive.stage("dac").line,
    "V",
    lambda effects: float(effects.drive.stage("dac").dac.transconductance_A_V),
)

TARGET = Target("dac", {**line_modes.modes(SIGNAL), **line_modes.silent_modes(SIGNAL)}, each_group=True)
