"""What a page knows of the bench that it drives: it tells it commands, and shows what it says."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator


class TicketProtocol(Protocol):
    """What becomes of a command."""

    @property
    def done(self) -> bool:
        """Whether it waits no more."""

    refused: str | None


class BenchProtocol(Protocol):
    """The machine: no call of it waits."""

    @property
    def actuator(self) -> Actuator:
        """Of the present run."""

    def command(self, name: str, /, *, client: str | None = None, **arguments: Any) -> TicketProtocol:
        """Tell it something."""

    def state(self) -> Any:
        """The latest picture."""

    def history(self) -> dict[str, NDArray[np.float64]]:
        """Rows of the last seconds, by signal."""

    def command_line(self) -> str:
        """The present settings as a command line."""


@dataclass(frozen=True)
class FieldSetting:
    """One field that a person may change, all of it as the command line writes it."""

    name: str
    """Dotted."""
    text: str
    """Its value."""
    default: str | None
    """None where it is not known, as of a law of a person's own."""
    meaning: str
    choices: tuple[str, ...] = ()
    """Where it can only be one of these."""


@dataclass(frozen=True)
class Choices:
    """What there is to choose from, and how text is read.

    Attributes
    ----------
    settings : callable
        Every field of the present run.
    shape : callable
        Fields of a shape of trajectory, by its name, with their defaults.
    read : callable
        Value of a text for a field, as the command line reads it.
    scenarios, shapes, laws : sequence of str
        Names.
    limits : (float, float), rad/s and rad/s²
        Of the way to a pose, until others are set.
    targets : dict
        Of faults: what can happen to each, by its name.
    """

    settings: Callable[[], list[FieldSetting]]
    shape: Callable[[str], list[FieldSetting]]
    read: Callable[[str, str], Any]
    scenarios: Sequence[str]
    shapes: Sequence[str]
    laws: Sequence[str]
    limits: tuple[float, float]
    targets: dict[str, tuple[str, ...]]
