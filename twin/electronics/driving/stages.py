"""One name for what comes between commands and currents: a plain lag, the whole chain, or it with faults.

As `plant.stepping` does for engines: the loop is compiled for one of them, and the others are not compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.twin.electronics.driving import chain, faulty
from spheretwin.twin.electronics.driving.chain import Driving
from spheretwin.twin.electronics.driving.delay import due
from spheretwin.twin.electronics.driving.faulty import DriveFaults, FaultyDriving
from spheretwin.twin.electronics.driving.lag import Drive, advance, drive
from spheretwin.twin.electronics.driving.sections import ResolvedDrive


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
    advance(driving.drive, command, current, mean)


@part_of_its_caller
def _lag_ends(driving: Any) -> bool:
    return True


@part_of_its_caller
def _lag_tells(driving: Any, row: Any) -> None:
    pass


Stages = Lag | Driving | FaultyDriving

_BEGIN: dict[type, Any] = {Lag: _lag_begins, Driving: chain.begin, FaultyDriving: faulty.begin}
_ADVANCE: dict[type, Any] = {Lag: _lag_advances, Driving: chain.advance, FaultyDriving: faulty.advance}
_END: dict[type, Any] = {Lag: _lag_ends, Driving: chain.end, FaultyDriving: faulty.end}
_TELL: dict[type, Any] = {Lag: _lag_tells, Driving: chain.tell, FaultyDriving: faulty.tell}


def made(
    section: ResolvedDrive,
    step_s: float,
    substeps: int,
    groups: int,
    seed: int,
    faults: DriveFaults | None = None,
    most_late_steps: int = 0,
) -> Stages:
    """What a resolved section asks for, at rest.

    Parameters
    ----------
    section, step_s, substeps, groups, seed
        As `chain.driving` has them.
    faults : DriveFaults, optional
        Where something may fail.
    most_late_steps : int
        Physics steps that a fault may delay a command by.
    """
    if faults is not None:
        return faulty.faulty_driving(
            chain.driving(section, step_s, substeps, groups, seed), faults, most_late_steps
        )
    if section.supply_V is None and not section.converts:
        return Lag(drive(section.lag_s, step_s, section.current_limit_A))
    return chain.driving(section, step_s, substeps, groups, seed)


def state_of(driving: Stages) -> NDArray:
    """All that it goes on from, beside the currents."""
    if isinstance(driving, Lag):
        return np.empty(0)
    return faulty.state_of(driving) if isinstance(driving, FaultyDriving) else chain.state_of(driving)


def restore(driving: Stages, state: NDArray) -> None:
    """Go on from a state of one of the same size."""
    if isinstance(driving, FaultyDriving):
        faulty.restore(driving, state)
    elif isinstance(driving, Driving):
        chain.restore(driving, state)


def carried_on(before: Stages, after: Stages, command: NDArray) -> None:
    """Go on as before with other figures, from the last commands (n,), A."""
    healthy, now = _healthy(before), _healthy(after)
    if isinstance(healthy, Driving) and isinstance(now, Driving):
        chain.carried_on(healthy, now)
    if isinstance(after, FaultyDriving):
        if isinstance(before, FaultyDriving):
            after.faults.last_A[:] = before.faults.last_A
        elif isinstance(before, Driving) and before.converts:
            due(before.delay, before.delay.substeps - 1, after.faults.last_A)
        else:  # right behind its commands, of which it kept none
            after.faults.last_A[:] = after.driving.delay.ring[:] = command


def _healthy(driving: Stages) -> Lag | Driving:
    return driving.driving if isinstance(driving, FaultyDriving) else driving


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
