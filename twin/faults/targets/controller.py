"""The controller as seen from its wires: its commands come late, stay what they were, or do not come."""

from spheretwin.twin.electronics.driving.faulty import HANGING, SILENT
from spheretwin.twin.faults.target import STRETCH, Effects, Mode, Strike, Target, Value


def _hang(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    if effects.drive.leaves[0] != SILENT:
        effects.drive.leaves[0] = HANGING


def _silence(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    effects.drive.leaves[0] = SILENT


def _delay(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    effects.drive.late_steps[0] += round(strike.value / effects.step_s)


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
