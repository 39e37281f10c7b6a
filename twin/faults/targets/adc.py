"""The converter of the potentiometers' voltages: held, shifted, scaled, noisy, silent or late."""

from spheretwin.twin.electronics.sensing.faulty import ADC
from spheretwin.twin.faults import readings
from spheretwin.twin.faults.target import STRETCH, Effects, Mode, Strike, Target, Value


def _silence(effects: Effects, strike: Strike) -> None:
    effects.sensors.acts[0] = effects.sensors.silent[0] = True


def _delay(effects: Effects, strike: Strike) -> None:
    effects.sensors.acts[0] = True
    effects.sensors.late_ticks[0] += round(strike.value / effects.period_s)


TARGET = Target(
    "adc",
    {
        **readings.modes(lambda strike: ADC, "V"),
        "dropout": Mode(_silence),
        "delay": Mode(_delay, Value("how late it is, s; whole control periods", 0.0, 1.0)),
        "intermittent": Mode(_silence, STRETCH, intermittent=True),
    },
)
