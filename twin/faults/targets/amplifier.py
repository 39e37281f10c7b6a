"""The amplifier of a group: its output open (shut down), or driving what it was not asked for."""

from spheretwin.twin.electronics.driving.undriven import OPEN
from spheretwin.twin.faults import lines
from spheretwin.twin.faults.target import (
    GAIN,
    STRETCH,
    Effects,
    Mode,
    Strike,
    Target,
    held,
    noise,
    offset,
)

SOURCE = 1
"""Of noise."""


def _open(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    effects.drive.contact[strike.place] = OPEN


def _noise(effects: Effects, strike: Strike) -> None:
    lines.add_noise(effects.drive, strike, SOURCE, strike.value)


TARGET = Target(
    "amplifier",
    {
        "open": Mode(_open),
        "stuck": Mode(lambda effects, strike: lines.hold(effects.drive, strike, 1.0), held("A")),
        "offset": Mode(lambda effects, strike: lines.shift(effects.drive, strike, 1.0), offset("A")),
        "gain": Mode(lambda effects, strike: lines.scale(effects.drive, strike), GAIN),
        "noise": Mode(_noise, noise("A")),
        "dropout": Mode(lambda effects, strike: lines.silence(effects.drive, strike)),
        "intermittent": Mode(
            lambda effects, strike: lines.silence(effects.drive, strike), STRETCH, intermittent=True
        ),
    },
    each_group=True,
)
