"""The encoder of γ: a counter that stops or is silent, lost counts, lines that are missed."""

from spheretwin.twin.electronics.sensing.faulty import ENCODER
from spheretwin.twin.faults import readings
from spheretwin.twin.faults.target import STRETCH, Effects, Mode, Strike, Target


def _silence(effects: Effects, strike: Strike) -> None:
    effects.sensors.acts[1] = effects.sensors.silent[1] = True


TARGET = Target(
    "encoder",
    {
        **readings.modes(lambda strike: ENCODER, "rad"),
        "dropout": Mode(_silence),
        "intermittent": Mode(_silence, STRETCH, intermittent=True),
    },
    places=("gamma",),
)
