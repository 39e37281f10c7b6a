"""Metadata of a telemetry file: everything needed to repeat the run."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.telemetry.status import Status, named

_RUN = "scenario, journal and ticks of a run"


class Change(NamedTuple):
    """Change of a field: an entry of the command journal."""

    tick: int
    """First tick with the new value."""
    name: str
    value: Any


@dataclass(frozen=True)
class RunRecord:
    """Typed metadata of a telemetry file; it is the same for two equal runs.

    Attributes
    ----------
    scenario : mapping
        Scenario at tick 0, by section, as JSON.
    journal : tuple of Change
        Changes during the run.
    ticks : int
        Completed control ticks.
    files : mapping of str
        Digest of each model and curve by its path; None for one that could not be read.
    versions : mapping of str
        Versions of Python and of every package that may affect a figure.
    first_tick : int
        Control tick of the first row; earlier ones were not stored.
    status : Status, optional
        Final status; None during the run, and in the files of a killed run.
    """

    scenario: Mapping[str, Any]
    journal: tuple[Change, ...]
    ticks: int
    files: Mapping[str, str | None]
    versions: Mapping[str, str]
    status: Status | None = None
    first_tick: int = 0

    def metadata(self) -> dict[str, str]:
        """Return the record as texts by name, for a file."""
        texts = {
            "scenario": json.dumps(self.scenario),
            "journal": json.dumps(self.journal),
            "ticks": str(self.ticks),
            "files": json.dumps(self.files),
            "versions": json.dumps(self.versions),
        }
        if self.first_tick:
            texts["first_tick"] = str(self.first_tick)
        return texts if self.status is None else {**texts, "status": str(self.status)}

    @classmethod
    def from_metadata(cls, texts: Mapping[str, str]) -> RunRecord:
        """Read the record from the texts of a file; those of older versions lack files or versions.

        Raises
        ------
        InputError
            Scenario, journal or ticks are missing, or a text is invalid.
        """
        return cls(
            scenario=_read(texts, "scenario", _mapping),
            journal=_read(texts, "journal", _journal),
            ticks=_read(texts, "ticks", int),
            files=_read(texts, "files", _mapping, "{}"),
            versions=_read(texts, "versions", _mapping, "{}"),
            status=named(texts["status"]) if "status" in texts else None,
            first_tick=_read(texts, "first_tick", int, "0"),
        )


def _read(
    texts: Mapping[str, str], name: str, parse: Callable[[str], Any], default: str | None = None
) -> Any:
    """Read the value of a text; raise `InputError` if it is invalid, or missing without a default."""
    expected = f"metadata: expected {_RUN}"
    text = texts.get(name, default)
    if text is None:
        raise InputError(f"{expected}, received no {name}")
    try:
        return parse(text)
    except (TypeError, ValueError, OverflowError, RecursionError):
        raise InputError(f"{expected}, received {name} as {shown(text)}") from None


def _mapping(text: str) -> Mapping[str, Any]:
    fields = json.loads(text)
    if not isinstance(fields, dict):
        raise TypeError
    return fields


def _journal(text: str) -> tuple[Change, ...]:
    return tuple(Change(int(tick), str(name), value) for tick, name, value in json.loads(text))


@dataclass(frozen=True)
class RunFacts:
    """Facts of a run known from its start, independent of the structure of a scenario.

    Attributes
    ----------
    name, description : str
        Of the scenario.
    law : str
        Name of the law at the start.
    duration_s : float
        Planned length, s.
    current_limit_A : float
        Largest group current of the amplifiers, A.
    payload_kg : float
        Mass on the shaft's payload mount, kg.
    gravity_m_s2 : float or None
        Gravity along -z of the stator, m/s²; None if the model has gravity in another direction.
    mjcf : Path
        Model file.
    sections : mapping of mappings
        Everything that the run depends on, for display: JSON value by field by section.
    changed : mapping
        Values that were chosen, or that differ from their defaults, by dotted name.
    replay_of : str
        Name of the file whose run is replayed; empty for any other run.
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
    changed: Mapping[str, Any] = field(default_factory=dict)
    replay_of: str = ""


PACKAGES = ("spheretwin", "mujoco", "numba", "numpy", "scipy", "pydantic", "pyarrow", "rerun-sdk")


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python and of every package that may affect a figure."""
    versions_by_package = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions_by_package[package] = version(package)
        except PackageNotFoundError:
            continue
    return versions_by_package
