"""The controller as seen from its wires: its commands come late, stay what they were, or do not come."""

from spheretwin.twin.electronics.driving.chain import HANGING, SILENT
from spheretwin.twin.faults.target import STRETCH, ActiveFault, Effects, Mode, Target, Value


def _hang(effects: Effects, fault: ActiveFault) -> None:
    if effects.drive.output.leaves[0] != SILENT:
        effects.drive.output.leaves[0] = HANGING


def _silence(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.output.leaves[0] = SILENT


def _delay(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.output.late_steps[0] += round(fault.value / effects.step_s)


TARGET = Target(
    "controller",
    {
        "stuck": Mode(_hang),
        "dropout": Mode(_silence),
        "delay": Mode(
            _delay, Value("how much later a command is in force, s; whole physics steps", 0.0, 1.0)
        ),
        "intermittent": Mode(_hang, STRETCH, intermittent=True),
    },
)
