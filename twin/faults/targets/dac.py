"""A channel of the converter of commands: held, shifted, scaled, noisy, or at 0 V."""

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

SOURCE = 0
"""Of noise."""


def _hold(effects: Effects, strike: Strike) -> None:
    lines.hold(effects.drive, strike, effects.transconductance_A_V)


def _shift(effects: Effects, strike: Strike) -> None:
    lines.shift(effects.drive, strike, effects.transconductance_A_V)


def _noise(effects: Effects, strike: Strike) -> None:
    lines.add_noise(effects.drive, strike, SOURCE, effects.transconductance_A_V * strike.value)


TARGET = Target(
    "dac",
    {
        "stuck": Mode(_hold, held("V")),
        "offset": Mode(_shift, offset("V")),
        "gain": Mode(lambda effects, strike: lines.scale(effects.drive, strike), GAIN),
        "noise": Mode(_noise, noise("V")),
        "dropout": Mode(lambda effects, strike: lines.silence(effects.drive, strike)),
        "intermittent": Mode(
            lambda effects, strike: lines.silence(effects.drive, strike), STRETCH, intermittent=True
        ),
    },
    each_group=True,
)
