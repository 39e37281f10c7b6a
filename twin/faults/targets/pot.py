"""The potentiometers of α and β: a wiper off its track, a short, a slip on the shaft, a worn track."""

from spheretwin.twin.faults import readings
from spheretwin.twin.faults.target import STRETCH, Effects, Mode, Strike, Target, Value


def _open(effects: Effects, strike: Strike) -> None:
    readings.fix(effects.sensors, strike.place, strike.value)


def _open_now_and_then(effects: Effects, strike: Strike) -> None:
    readings.fix(effects.sensors, strike.place, 0.0)


def _short(effects: Effects, strike: Strike) -> None:
    readings.fix(effects.sensors, strike.place, effects.track_V / 2)


TARGET = Target(
    "pot",
    {
        "open": Mode(_open, Value("what the converter's input drifts to, V", default=0.0)),
        "short": Mode(_short),  # to the positive end of the track
        **readings.modes(lambda strike: strike.place, "rad", lambda effects: effects.volts_per_rad),
        "intermittent": Mode(_open_now_and_then, STRETCH, intermittent=True),
    },
    places=("alpha", "beta"),
)
