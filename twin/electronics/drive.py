"""Drive of all groups: a plain current lag or the chain of drive stages, under common functions.

As with the engines in `plant.plant_tick`, the loop is compiled only for the drive that a run has.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numpy.typing import NDArray

from spheretwin.electronics import drive_chain as chain
from spheretwin.electronics.coil import CurrentLag, advance_lag, current_lag
from spheretwin.electronics.drive_chain import DriveChain, DriveFaults, drive_chain
from spheretwin.electronics.drive_section import ResolvedDrive
from spheretwin.models.base.compiled import implements, inlined


class LagDrive(NamedTuple):
    """Amplifiers without a supply and without delay: a first-order lag of the currents."""

    lag: CurrentLag


@inlined
def _lag_begin(drive: Any, command: Any) -> None:
    pass


@inlined
def _lag_advance(
    drive: Any, command: Any, substep: Any, q: Any, qdot: Any, G: Any, gain: Any, current: Any, mean: Any
) -> None:
    advance_lag(drive.lag, command, current, mean)


@inlined
def _lag_end(drive: Any) -> bool:
    return True


@inlined
def _lag_write_telemetry(drive: Any, row: Any) -> None:
    pass


DriveModel = LagDrive | DriveChain

_BEGIN: dict[type, Any] = {LagDrive: _lag_begin, DriveChain: chain.begin}
_ADVANCE: dict[type, Any] = {LagDrive: _lag_advance, DriveChain: chain.advance}
_END: dict[type, Any] = {LagDrive: _lag_end, DriveChain: chain.end}
_WRITE_TELEMETRY: dict[type, Any] = {LagDrive: _lag_write_telemetry, DriveChain: chain.write_telemetry}


def build_drive(
    section: ResolvedDrive,
    step_s: float,
    substeps: int,
    groups: int,
    seed: int,
    faults: DriveFaults | None = None,
    mutual_H: NDArray | None = None,
) -> DriveModel:
    """Return the drive of a resolved section, at rest.

    Parameters
    ----------
    section, step_s, substeps, groups, seed, faults, mutual_H
        As in `drive_chain.drive_chain`.
    """
    if section.supply_V is None and not section.converts and faults is None:
        return LagDrive(current_lag(section.lag_s, step_s, section.current_limit_A, groups))
    return drive_chain(section, step_s, substeps, groups, seed, faults, mutual_H)


def transfer_drive(before: DriveModel, after: DriveModel, command: NDArray) -> None:
    """Transfer the state to a drive with other parameters, from the last commands (n,), A."""
    if isinstance(after, DriveChain):
        chain.transfer(before if isinstance(before, DriveChain) else None, after, command)


def begin(drive: DriveModel, command: NDArray) -> None:
    """Accept the commands (n,), A, of a control period."""
    _BEGIN[type(drive)](drive, command)


def advance_currents(
    drive: DriveModel,
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
    _ADVANCE[type(drive)](drive, command, substep, q, qdot, G, gain, current, mean)


def end(drive: DriveModel) -> bool:
    """End a control period; return True if no coil is too hot."""
    return bool(_END[type(drive)](drive))


def write_telemetry(drive: DriveModel, row: NDArray) -> None:
    """Write the telemetry of the control period; a lag has none."""
    _WRITE_TELEMETRY[type(drive)](drive, row)


def _of_kind(table: dict[type, Any], drive: Any) -> Any:
    return table.get(getattr(drive, "instance_class", object))


@implements(begin, inline=True)
def _compiled_begin(drive: Any, command: Any) -> Callable[..., Any] | None:
    implementation = _of_kind(_BEGIN, drive)

    def call(drive: Any, command: Any) -> None:
        implementation(drive, command)

    return call if implementation else None


@implements(advance_currents, inline=True)
def _compiled_advance(
    drive: Any, command: Any, substep: Any, q: Any, qdot: Any, G: Any, gain: Any, current: Any, mean: Any
) -> Callable[..., Any] | None:
    implementation = _of_kind(_ADVANCE, drive)

    def call(
        drive: Any,
        command: Any,
        substep: Any,
        q: Any,
        qdot: Any,
        G: Any,
        gain: Any,
        current: Any,
        mean: Any,
    ) -> None:
        implementation(drive, command, substep, q, qdot, G, gain, current, mean)

    return call if implementation else None


@implements(end, inline=True)
def _compiled_end(drive: Any) -> Callable[..., Any] | None:
    implementation = _of_kind(_END, drive)

    def call(drive: Any) -> Any:
        return implementation(drive)

    return call if implementation else None


@implements(write_telemetry, inline=True)
def _compiled_write_telemetry(drive: Any, row: Any) -> Callable[..., Any] | None:
    implementation = _of_kind(_WRITE_TELEMETRY, drive)

    def call(drive: Any, row: Any) -> None:
        implementation(drive, row)

    return call if implementation else None
