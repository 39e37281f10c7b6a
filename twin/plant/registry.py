"""The engines that can move the rotor: a new one is a file and a row."""

from __future__ import annotations

from spheretwin.twin.plant import engine, lagrangian
from spheretwin.twin.plant.rotor import EngineKind

ENGINES: dict[str, EngineKind] = {
    row.name: row
    for row in (
        engine.MUJOCO,
        lagrangian.LAGRANGIAN,
    )
}
