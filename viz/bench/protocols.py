"""Interface of the page to the bench: it sends commands and shows the status."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator

NO_REFERENCE = ("off", "manual", "fault")
"""Modes in which no reference applies: an error would be that against an old one."""


class TicketProtocol(Protocol):
    """Outcome of a command."""

    @property
    def done(self) -> bool:
        """True if it no longer waits."""

    refused: str | None


class Bins(NamedTuple):
    """Some bins of a history of rows, as arrays by signal, oldest first."""

    run: int
    """Number of the history: another one is another run."""
    numbers: list[int]
    rows: dict[str, NDArray[np.float64]]
    """First row of each."""
    low: dict[str, NDArray[np.float64]]
    high: dict[str, NDArray[np.float64]]


class BenchProtocol(Protocol):
    """The machine: no call of it waits."""

    @property
    def actuator(self) -> Actuator:
        """Actuator of the present run."""

    def command(self, name: str, /, *, client: str | None = None, **arguments: Any) -> TicketProtocol:
        """Tell it something."""

    def may_command(self, client: str) -> bool:
        """True if a client operates now."""

    def state(self) -> Any:
        """The latest picture."""

    def bins(self, after: int = -1) -> Bins:
        """Rows of the last minute in bins with a number above `after`."""

    def captured(self) -> dict[str, NDArray[np.float64]]:
        """Every row of the completed capture, by signal."""

    def command_line(self) -> str:
        """The present settings as a command line."""


@dataclass(frozen=True)
class FieldSetting:
    """Field that a person may change, in the notation of the command line."""

    name: str
    """Dotted."""
    text: str
    """Its value."""
    default: str | None
    """None if it has none."""
    meaning: str
    choices: tuple[str, ...] = ()
    """Valid values, if they are a list."""
    range: tuple[float, float] | None = None
    """Range of a slider for each of its numbers, if they are numbers."""


@dataclass(frozen=True)
class Choices:
    """Choices of the controls, and the conversion of text.

    Attributes
    ----------
    settings : callable
        Every field of the present run.
    shape : callable
        Fields of a shape of trajectory, by its name, with their defaults.
    read : callable
        Value of a text for a field, as the command line reads it.
    scenarios, laws, runs : callable
        Names of those of the package and of the folder; recorded runs of the folder.
    shapes : sequence of str
        Names.
    limits : (float, float), rad/s and rad/s²
        Limits of the approach to a pose, until others are set.
    targets : dict
        Fault targets by name, each with its modes.
    """

    settings: Callable[[], list[FieldSetting]]
    shape: Callable[[str], list[FieldSetting]]
    read: Callable[[str, str], Any]
    scenarios: Callable[[], Sequence[str]]
    shapes: Sequence[str]
    laws: Callable[[], Sequence[str]]
    runs: Callable[[], Sequence[str]]
    limits: tuple[float, float]
    targets: dict[str, tuple[str, ...]]
