"""The converter of the potentiometers' voltages: held, shifted, scaled, noisy, silent or late."""

from spheretwin.twin.electronics.sensing.faulty import ADC
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


def _hold(effects: Effects, strike: Strike) -> None:
    readings.hold(effects.sensors, ADC, strike, 1.0)


def _shift(effects: Effects, strike: Strike) -> None:
    readings.shift(effects.sensors, ADC, strike, 1.0)


def _scale(effects: Effects, strike: Strike) -> None:
    readings.scale(effects.sensors, ADC, strike)


def _noise(effects: Effects, strike: Strike) -> None:
    readings.add_noise(effects.sensors, ADC, strike, 1.0)


def _silence(effects: Effects, strike: Strike) -> None:
    effects.sensors.acts[0] = effects.sensors.silent[0] = True


def _delay(effects: Effects, strike: Strike) -> None:
    effects.sensors.acts[0] = True
    effects.sensors.late_ticks[0] += round(strike.value / effects.period_s)


TARGET = Target(
    "adc",
    {
        "stuck": Mode(_hold, held("V")),
        "offset": Mode(_shift, offset("V")),
        "gain": Mode(_scale, GAIN),
        "noise": Mode(_noise, noise("V")),
        "dropout": Mode(_silence),
        "delay": Mode(_delay, Value("how late it is, s; whole control periods", 0.0, 1.0)),
        "intermittent": Mode(_silence, STRETCH, intermittent=True),
    },
)
