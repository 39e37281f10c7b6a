"""The potentiometers of α and β: a wiper off its track, a short, a slip on the shaft, a worn track."""

from spheretwin.twin.faults import readings
from spheretwin.twin.faults.target import (
    GAIN,
    STRETCH,
    Effects,
    Mode,
    Strike,
    Target,
    Value,
    held,
    noise,
    offset,
)


def _open(effects: Effects, strike: Strike) -> None:
    readings.fix(effects.sensors, strike.place, strike.value)


def _open_now_and_then(effects: Effects, strike: Strike) -> None:
    readings.fix(effects.sensors, strike.place, 0.0)


def _short(effects: Effects, strike: Strike) -> None:
    readings.fix(effects.sensors, strike.place, effects.track_V / 2)


def _hold(effects: Effects, strike: Strike) -> None:
    readings.hold(effects.sensors, strike.place, strike, effects.volts_per_rad)


def _shift(effects: Effects, strike: Strike) -> None:
    readings.shift(effects.sensors, strike.place, strike, effects.volts_per_rad)


def _scale(effects: Effects, strike: Strike) -> None:
    readings.scale(effects.sensors, strike.place, strike)


def _noise(effects: Effects, strike: Strike) -> None:
    readings.add_noise(effects.sensors, strike.place, strike, effects.volts_per_rad)


TARGET = Target(
    "pot",
    {
        "open": Mode(_open, Value("what the converter's input drifts to, V", default=0.0)),
        "short": Mode(_short),  # to the positive end of the track
        "stuck": Mode(_hold, held("rad")),
        "offset": Mode(_shift, offset("rad")),
        "gain": Mode(_scale, GAIN),
        "noise": Mode(_noise, noise("rad")),
        "intermittent": Mode(_open_now_and_then, STRETCH, intermittent=True),
    },
    places=("alpha", "beta"),
)
