"""Log of a machine: currents and angles over time."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, Literal

import numpy as np

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.joint_states import group_names
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.models.telemetry.table import Table

COMMANDED: Final = "commanded"
MEASURED: Final = "measured"


CURRENT_SIGNALS = {COMMANDED: "current_command_A", MEASURED: "current_measured_A"}
CURRENTS, CONDITIONS, ACCEPTED = "currents", "conditions", "accepted"
"""Metadata of a log in Parquet and MCAP."""


@dataclass(frozen=True)
class Log:
    """Currents and angles of a machine, one row per sample.

    Attributes
    ----------
    t_s : (n,) array
        Time of the sample on the clock of the machine.
    current_A : (n, groups) array
        Current of each group; NaN where none was received.
    angle_rad : (n, 3) array
        Hinge angles as the sensors report them; NaN where none was received.
    currents : str
        ``commanded``: sent to the amplifiers at the time of the row, and held until the next;
        ``measured``: in the coils at the time of the row.
    name : str
        Name for messages and reports, such as the path of its file.
    conditions : mapping
        Known fields of the scenario under which it was recorded, such as ``{"plant.payload_kg": 0.05}``.
    accepted : tuple of str
        Findings of `check` that the user has accepted.
    notes : tuple of str
        How its file was read, if not as this package writes it.

    Raises
    ------
    InputError
        Fewer than two rows, shapes that do not fit each other, or another kind of currents.
    """

    t_s: Array
    current_A: Array
    angle_rad: Array
    currents: Literal["commanded", "measured"] = COMMANDED
    name: str = "log"
    conditions: Mapping[str, Any] = field(default_factory=dict)
    accepted: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for column in _COLUMNS:
            values = np.array(getattr(self, column), np.float64, order="C")
            values.setflags(write=False)
            object.__setattr__(self, column, values)
        rows = len(self.t_s) if self.t_s.ndim == 1 else 0
        if rows < 2:
            raise InputError(
                f"log {self.name}: expected at least two rows, received t_s of shape {self.t_s.shape}"
            )
        if self.current_A.ndim != 2 or len(self.current_A) != rows or self.angle_rad.shape != (rows, 3):
            raise InputError(
                f"log {self.name}: expected currents of ({rows}, groups) and angles of ({rows}, 3), received"
                f" {self.current_A.shape} and {self.angle_rad.shape}"
            )
        if self.currents not in (COMMANDED, MEASURED):
            raise InputError(
                f"log {self.name}: expected currents {COMMANDED} or {MEASURED}, received {self.currents!r}"
            )

    def __len__(self) -> int:
        return len(self.t_s)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the numbers, in hexadecimal; the same for each file format."""
        content = hashlib.sha256(self.currents.encode())
        for column in _COLUMNS:
            content.update(getattr(self, column).tobytes())
        return content.hexdigest()

    def rows(self, first: int, last: int) -> Log:
        """Return the rows from `first` to `last`, exclusive."""
        columns = {name: getattr(self, name)[first:last] for name in _COLUMNS}
        return replace(self, **columns)


_COLUMNS = ("t_s", "current_A", "angle_rad")


def log_of(run: Table, name: str = "log", conditions: Mapping[str, Any] | None = None) -> Log:
    """Return what a machine would log of a run: commanded currents and measured angles."""
    angles = "q_measured_rad" if "q_measured_rad" in run else "q_rad"
    return Log(run["t_s"], run["current_command_A"], run[angles], name=name, conditions=conditions or {})


LATEST_s, LARGEST = 1e12, 1e6
"""Largest time, and largest angle or current, rad or A: squares of larger numbers may overflow."""


def check_numbers(log: Log) -> None:
    """Refuse numbers that no machine has; NaN is a missing angle or current.

    Raises
    ------
    InputError
        A time is not finite, or a number is too large.
    """
    for column in _COLUMNS:
        values, largest = getattr(log, column), LATEST_s if column == "t_s" else LARGEST
        is_missing = np.isnan(values) & (column != "t_s")
        if not np.all(is_usable := is_missing | (np.abs(values) <= largest)):
            row = int(np.argwhere(~is_usable)[0, 0])
            raise InputError(
                f"log {log.name}: expected numbers from {-largest:g} to {largest:g} as {column}, received"
                f" {values[~is_usable][0]:g} in row {row}"
            )


def joined(logs: Sequence[Log]) -> Log:
    """Return logs that follow each other as one, with the name and the conditions of the first.

    Raises
    ------
    InputError
        No log, or other kinds of currents.
    """
    if not logs:
        raise InputError("log: expected at least one part, received none")
    first = logs[0]
    for other in logs:
        if other.currents != first.currents:
            raise InputError(
                f"log {first.name}: expected {first.currents} currents as before, received {other.currents}"
            )
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(log, name) for log in logs]) for name in _COLUMNS
    }
    return replace(first, **columns)


def log_signals(groups: int, kinds: tuple[str, ...]) -> tuple[Signal, ...]:
    """Return the signals of a log with the given kinds of currents."""
    labels = tuple(group_names(groups))
    meanings = {
        COMMANDED: "group currents commanded to the amplifiers",
        MEASURED: "group currents as measured",
    }
    return (
        Signal("t_s", "s", 1, "time of the sample"),
        Signal("angle_rad", "rad", 3, "hinge angles as measured", ANGLES),
        *(Signal(CURRENT_SIGNALS[kind], "A", groups, meanings[kind], labels) for kind in kinds),
    )


def conditions_of(payload_kg: float) -> dict[str, Any]:
    """Return the conditions of a run with a payload."""
    return {"plant.payload_kg": payload_kg} if payload_kg else {}
