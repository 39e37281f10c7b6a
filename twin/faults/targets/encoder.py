"""The encoder of γ: a counter that stops or is silent, lost counts, lines that are missed."""

from spheretwin.twin.electronics.sensing.faulty import ENCODER
from spheretwin.twin.faults import readings
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


def _hold(effects: Effects, strike: Strike) -> None:
    readings.hold(effects.sensors, ENCODER, strike, 1.0)


def _shift(effects: Effects, strike: Strike) -> None:
    readings.shift(effects.sensors, ENCODER, strike, 1.0)


def _scale(effects: Effects, strike: Strike) -> None:
    readings.scale(effects.sensors, ENCODER, strike)


def _noise(effects: Effects, strike: Strike) -> None:
    readings.add_noise(effects.sensors, ENCODER, strike, 1.0)


def _silence(effects: Effects, strike: Strike) -> None:
    effects.sensors.acts[1] = effects.sensors.silent[1] = True


TARGET = Target(
    "encoder",
    {
        "stuck": Mode(_hold, held("rad")),
        "offset": Mode(_shift, offset("rad")),
        "gain": Mode(_scale, GAIN),
        "noise": Mode(_noise, noise("rad")),
        "dropout": Mode(_silence),
        "intermittent": Mode(_silence, STRETCH, intermittent=True),
    },
    places=("gamma",),
)
