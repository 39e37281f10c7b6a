"""All parts of the cross-check, one after another: a new one is a file and a row."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.mjcf import beyond_a_free_rotor, read
from spheretwin.twin.crosscheck import (
    closed_loop,
    coil_driven,
    dynamics,
    free_rotor,
    friction,
    identities,
    trajectories,
)
from spheretwin.twin.crosscheck.part import STATES, Evidence, Finding, Subject

PARTS = (
    dynamics.PART,
    identities.PART,
    trajectories.PART,
    free_rotor.PART,
    friction.PART,
    coil_driven.PART,
    closed_loop.PART,
)


def run(
    mjcf: Path = actuators.MJCF_PATH, states: int = STATES, begun: Callable[[str], None] = lambda part: None
) -> Evidence:
    """Run every check.

    Parameters
    ----------
    mjcf : Path
        Model file; the shipped one unless given.
    states : int
        Random states at which formulas are compared.
    begun : callable
        Told the name of each of `PARTS` as it begins.

    Raises
    ------
    InputError
        The model cannot be read, or holds physics that the Lagrangian does not know.
    EngineError
        The reference trajectory could not be integrated.
    """
    subject = Subject(mjcf, actuators.load(mjcf), states)
    if unknown := beyond_a_free_rotor(read(mjcf).loaded):
        raise InputError(
            f"crosscheck {mjcf}: expected a rigid rotor on three ideal hinges, which the Lagrangian is,"
            f" received a model with {', '.join(unknown)}"
        )
    findings: dict[str, Finding] = {}
    for part in PARTS:
        begun(part.name)
        findings[part.name] = part.examine(subject)
    return Evidence(findings)
