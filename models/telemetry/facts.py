"""What whoever follows a run is told of it before its first row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class RunFacts:
    """What is known of a run from its start, without a word of how a scenario is built.

    Attributes
    ----------
    name, description : str
        Of the scenario.
    law : str
        Name of the law that it begins under.
    duration_s : float
        Planned length, s.
    current_limit_A : float
        Largest group current of the amplifiers, A.
    payload_kg : float
        Mass on the shaft's payload mount, kg.
    gravity_m_s2 : float or None
        Gravity along -z of the stator, m/s²; None where the model's own acts, which is along another line.
    mjcf : Path
        Model file.
    sections : mapping of mappings
        Everything that the run depends on, for people: value by field by section, as JSON has values.
    """

    name: str
    description: str
    law: str
    duration_s: float
    current_limit_A: float
    payload_kg: float
    gravity_m_s2: float | None
    mjcf: Path
    sections: Mapping[str, Mapping[str, Any]]
