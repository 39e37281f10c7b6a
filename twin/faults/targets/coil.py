"""The coils of a group: open, shorted at their ends, or with fewer turns than they should have."""

from spheretwin.twin.electronics.driving.coil import OPEN, SHORTED
from spheretwin.twin.faults.target import STRETCH, ActiveFault, Effects, Mode, Target, Value


def _open(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.coil.contact[fault.place] = OPEN


def _short(effects: Effects, fault: ActiveFault) -> None:
    if effects.drive.coil.contact[fault.place] != OPEN:  # an open lead stays open, whatever lies behind it
        effects.drive.coil.contact[fault.place] = SHORTED


def _fewer_turns(effects: Effects, fault: ActiveFault) -> None:
    # Resistance and inductance stay: a few turns change them less than the torque of the others matters.
    effects.group_gain[fault.place] *= fault.value


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
