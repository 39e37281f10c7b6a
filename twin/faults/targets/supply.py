"""The supply of all amplifiers: gone, low, or with a ripple; what is left of it limits every group."""

from spheretwin.twin.faults import line_modes
from spheretwin.twin.faults.line_modes import Signal
from spheretwin.twin.faults.target import GAIN, Target, offset

SIGNAL = Signal(lambda effects: effects.drive.supply, "V")

_MODES = line_modes.modes(SIGNAL)

TARGET = Target(
    "supply",
    {
        "offset": _MODES["offset"]._replace(value=offset("V of either sign")),
        "gain": _MODES["gain"]._replace(value=GAIN._replace(least=0.0)),
        "noise": _MODES["noise"],
        **line_modes.silent_modes(SIGNAL),
    },
    needs_supply=True,
)
