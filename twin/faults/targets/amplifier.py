"""The amplifier of a group: its output open (shut down), or driving what it was not asked for."""

from spheretwin.twin.electronics.driving.undriven import OPEN
from spheretwin.twin.faults import lines
from spheretwin.twin.faults.target import Effects, Mode, Strike, Target

SOURCE = 1
"""Of noise."""


def _open(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    effects.drive.contact[strike.place] = OPEN


TARGET = Target("amplifier", {"open": Mode(_open), **lines.modes(SOURCE, "A")}, each_group=True)
