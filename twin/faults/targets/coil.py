"""The coils of a group: open, shorted at their ends, or with fewer turns than they should have."""

from spheretwin.twin.electronics.driving.undriven import OPEN, SHORTED
from spheretwin.twin.faults.target import STRETCH, Effects, Mode, Strike, Target, Value


def _open(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    effects.drive.contact[strike.place] = OPEN


def _short(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    if effects.drive.contact[strike.place] != OPEN:  # an open lead stays open, whatever lies behind it
        effects.drive.contact[strike.place] = SHORTED


def _fewer_turns(effects: Effects, strike: Strike) -> None:
    # Resistance and inductance stay: a few turns change them less than the torque of the others matters.
    effects.group_gain[strike.place] *= strike.value


TARGET = Target(
    "coil",
    {
        "open": Mode(_open),
        "short": Mode(_short),
        "gain": Mode(
            _fewer_turns, Value("factor on torque and back-EMF an ampere: turns that are left", 0.0, 1.0)
        ),
        "intermittent": Mode(_open, STRETCH, intermittent=True),
    },
    each_group=True,
)
