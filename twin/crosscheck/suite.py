"""All parts of the cross-check, one after another, and what they leave."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from spheretwin.models import actuator as actuators
from spheretwin.models.base.check import Check
from spheretwin.models.base.errors import InputError
from spheretwin.models.mjcf import beyond_a_free_rotor, read
from spheretwin.twin.crosscheck import STATES, closed_loop, dynamics, free_rotor, identities, trajectories
from spheretwin.twin.crosscheck.closed_loop import ClosedLoop
from spheretwin.twin.crosscheck.dynamics import Dynamics
from spheretwin.twin.crosscheck.free_rotor import FreeRotor
from spheretwin.twin.crosscheck.trajectories import Trajectories

PARTS = ("dynamics", "identities", "trajectories", "torque-free rotor", "closed loop")


class Evidence(NamedTuple):
    """All checks, part by part, and what they were taken from."""

    dynamics: Dynamics
    identities: list[Check]
    trajectories: Trajectories
    free_rotor: FreeRotor
    closed_loop: ClosedLoop

    @property
    def checks(self) -> list[Check]:
        """Every check, in the order of the parts."""
        return [
            *self.dynamics.checks,
            *self.identities,
            *self.trajectories.checks,
            *self.free_rotor.checks,
            *self.closed_loop.checks,
        ]


def run(
    mjcf: Path = actuators.MJCF_PATH, states: int = STATES, begun: Callable[[str], None] = lambda part: None
) -> Evidence:
    """Run every check.

    Parameters
    ----------
    mjcf : Path
        Model file; the shipped one unless given.
    states : int
        Random states at which the dynamics are compared.
    begun : callable
        Told the name of each of `PARTS` as it begins.

    Raises
    ------
    InputError
        The model cannot be read, or holds physics that the Lagrangian does not know.
    EngineError
        The reference trajectory could not be integrated.
    """
    actuator = actuators.load(mjcf)
    if unknown := beyond_a_free_rotor(read(mjcf).loaded):
        raise InputError(
            f"crosscheck {mjcf}: expected a rigid rotor on three ideal hinges, which the Lagrangian is,"
            f" received a model with {', '.join(unknown)}"
        )
    begun("dynamics")
    compared = dynamics.compare(mjcf, actuator, states)
    begun("identities")
    satisfied = identities.check(actuator, states)
    begun("trajectories")
    followed = trajectories.compare(mjcf, actuator)
    begun("torque-free rotor")
    flown = free_rotor.check(mjcf, actuator)
    begun("closed loop")
    return Evidence(compared, satisfied, followed, flown, closed_loop.compare(mjcf))
