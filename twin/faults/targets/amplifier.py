"""The amplifier of a group: its output open (shut down), or driving what it was not asked for."""

from spheretwin.twin.electronics.driving.coil import OPEN
from spheretwin.twin.faults import line_modes
from spheretwin.twin.faults.line_modes import Signal
from spheretwin.twin.faults.target import ActiveFault, Effects, Mode, Target


def _open(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.coil.contact[fault.place] = OPEN


SIGNAL = Signal(lambda effects: effects.drive.stage("amplifier").line, "A")

TARGET = Target(
    "amplifier",
    {"open": Mode(_open), **line_modes.modes(SIGNAL), **line_modes.silent_modes(SIGNAL)},
    each_group=True,
)
