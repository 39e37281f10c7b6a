"""The potentiometers of α and β: a wiper off its track, a short, a slip on the shaft, a worn track."""

from spheretwin.twin.electronics.sensing.potentiometer import Potentiometers
from spheretwin.twin.faults import line_modes
from spheretwin.twin.faults.line_modes import Signal
from spheretwin.twin.faults.target import STRETCH, ActiveFault, Effects, Mode, Target, Value


def _stage(effects: Effects) -> Potentiometers:
    stage: Potentiometers = effects.sensors.stage("potentiometer")
    return stage


def _open(effects: Effects, fault: ActiveFault) -> None:
    stage = _stage(effects)
    line_modes.fix(stage.line, fault.place, fault.value / stage.volts_per_rad)


def _open_now_and_then(effects: Effects, fault: ActiveFault) -> None:
    line_modes.fix(_stage(effects).line, fault.place, 0.0)


def _short(effects: Effects, fault: ActiveFault) -> None:
    stage = _stage(effects)
    line_modes.fix(stage.line, fault.place, stage.channels[0].half_angle_rad)


TARGET = Target(
    "pot",
    {
        "open": Mode(_open, Value("what the converter's input drifts to, V", default=0.0)),
        "short": Mode(_short),  # to the positive end of the track
        **line_modes.modes(Signal(lambda effects: _stage(effects).line, "rad")),
        "intermittent": Mode(_open_now_and_then, STRETCH, intermittent=True),
    },
    places=("alpha", "beta"),
    measured=True,
)
