"""One name for what comes between commands and currents: a plain lag, or the chain of the drive's stages.

As `plant.stepping` does for engines: the loop is compiled for one of them, and the other is not compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba.extending import overload
from numpy.typing import NDArray

from spheretwin.electronics import drive_chain as chain
from spheretwin.electronics.drive_chain import (
    Drive,
    DriveChain,
    DriveFaults,
    ResolvedDrive,
    advance_lag,
    drive,
    drive_chain,
)
from spheretwin.models.base.compiled import part_of_its_caller


class Lag(NamedTuple):
    """Amplifiers without a supply, right behind their commands."""

    drive: Drive


@part_of_its_caller
def _lag_begins(driving: Any, command: Any) -> None:
    pass


@part_of_its_caller
def _lag_advances(
    driving: Any, command: Any, substep: Any, q: Any, qdot: Any, G: Any, gain: Any, current: Any, mean: Any
) -> None:
    advance_lag(driving.drive, command, current, mean)


@part_of_its_caller
def _lag_ends(driving: Any) -> bool:
    return True


@part_of_its_caller
def _lag_tells(driving: Any, row: Any) -> None:
    pass


Stages = Lag | DriveChain

_BEGIN: dict[type, Any] = {Lag: _lag_begins, DriveChain: chain.begin}
_ADVANCE: dict[type, Any] = {Lag: _lag_advances, DriveChain: chain.advance}
_END: dict[type, Any] = {Lag: _lag_ends, DriveChain: chain.end}
_TELL: dict[type, Any] = {Lag: _lag_tells, DriveChain: chain.tell}


def made(
    section: ResolvedDrive,
    step_s: float,
    substeps: int,
    groups: int,
    seed: int,
    faults: DriveFaults | None = None,
) -> Stages:
    """What a resolved section asks for, at rest.

    Parameters
    ----------
    section, step_s, substeps, groups, seed, faults
        As `chain.drive_chain` has them.
    """
    if section.supply_V is None and not section.converts and faults is None:
        return Lag(drive(section.lag_s, step_s, section.current_limit_A))
    return drive_chain(section, step_s, substeps, groups, seed, faults)


def carried_on(before: Stages, after: Stages, command: NDArray) -> None:
    """Go on as before with other figures, from the last commands (n,), A."""
    if isinstance(after, DriveChain):
        chain.transfer(before if isinstance(before, DriveChain) else None, after, command)


def begin(driving: Stages, command: NDArray) -> None:
    """Take the commands (n,), A, of a control period."""
    _BEGIN[type(driving)](driving, command)


def advance_currents(
    driving: Stages,
    command: NDArray,
    substep: int,
    q: NDArray,
    qdot: NDArray,
    G: NDArray,
    gain: NDArray,
    current: NDArray,
    mean: NDArray,
) -> None:
    """Advance the currents by one physics step, as `chain.advance` does."""
    _ADVANCE[type(driving)](driving, command, substep, q, qdot, G, gain, current, mean)


def end(driving: Stages) -> bool:
    """End a control period; whether the amplifiers may go on."""
    return bool(_END[type(driving)](driving))


def tell(driving: Stages, row: NDArray) -> None:
    """Write what the telemetry says of the control period; a lag says nothing."""
    _TELL[type(driving)](driving, row)


def _of_kind(table: dict[type, Any], driving: Any) -> Any:
    return table.get(getattr(driving, "instance_class", object))


@overload(begin, inline="always")
def _compiled_begin(driving: Any, command: Any) -> Callable[..., Any] | None:
    chosen = _of_kind(_BEGIN, driving)

    def call(driving: Any, command: Any) -> None:
        chosen(driving, command)

    return call if chosen else None


@overload(advance_currents, inline="always")
def _compiled_advance(
    driving: Any, command: Any, substep: Any, q: Any, qdot: Any, G: Any, gain: Any, current: Any, mean: Any
) -> Callable[..., Any] | None:
    chosen = _of_kind(_ADVANCE, driving)

    def call(
        driving: Any,
        command: Any,
        substep: Any,
        q: Any,
        qdot: Any,
        G: Any,
        gain: Any,
        current: Any,
        mean: Any,
    ) -> None:
        chosen(driving, command, substep, q, qdot, G, gain, current, mean)

    return call if chosen else None


@overload(end, inline="always")
def _compiled_end(driving: Any) -> Callable[..., Any] | None:
    chosen = _of_kind(_END, driving)

    def call(driving: Any) -> Any:
        return chosen(driving)

    return call if chosen else None


@overload(tell, inline="always")
def _compiled_tell(driving: Any, row: Any) -> Callable[..., Any] | None:
    chosen = _of_kind(_TELL, driving)

    def call(driving: Any, row: Any) -> None:
        chosen(driving, row)

    return call if chosen else None
