"""The converter of the potentiometers' voltages: held, shifted, scaled, noisy, silent or late."""

from spheretwin.twin.faults import line_modes
from spheretwin.twin.faults.line_modes import Signal
from spheretwin.twin.faults.target import STRETCH, ActiveFault, Effects, Mode, Target, Value


def _silence(effects: Effects, fault: ActiveFault) -> None:
    effects.sensors.silent[:2] = True


def _delay(effects: Effects, fault: ActiveFault) -> None:
    effects.sensors.stage("adc").late_ticks[0] += round(fault.value / effects.period_s)


SIGNAL = Signal(
    lambda effects: effects.sensors.stage("adc").line,
    "V",
    lambda effects: 1.0 / effects.sensors.stage("adc").volts_per_rad,
    every_channel=True,
)

TARGET = Target(
    "adc",
    {
        **line_modes.modes(SIGNAL),
        "dropout": Mode(_silence),
        "delay": Mode(_delay, Value("how late it is, s; whole control periods", 0.0, 1.0)),
        "intermittent": Mode(_silence, STRETCH, intermittent=True),
    },
    measured=True,
)
