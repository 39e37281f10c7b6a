"""The encoder of γ: a counter that stops or is silent, lost counts, lines that are missed."""

from spheretwin.twin.faults import line_modes
from spheretwin.twin.faults.line_modes import Signal
from spheretwin.twin.faults.target import STRETCH, ActiveFault, Effects, Mode, Target


def _silence(effects: Effects, fault: ActiveFault) -> None:
    effects.sensors.silent[2] = True


TARGET = Target(
    "encoder",
    {
        **line_modes.modes(Signal(lambda effects: effects.sensors.stage("encoder").line, "rad")),
        "dropout": Mode(_silence),
        "intermittent": Mode(_silence, STRETCH, intermittent=True),
    },
    places=("gamma",),
    measured=True,
)
