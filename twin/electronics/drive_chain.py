"""Drive chain: the stages from commands to currents of all groups, over a control period.

Once in each control tick the stages convert the command, which is then delayed. At each physics step the
active command passes the stages again and becomes the setpoint of the amplifiers. A fault modifies a stage,
by its fault line or by another field. Faults of converters and amplifiers act after the delay, where a
converter latches. Faults of the coils change their connection, faults of the supply its voltage, faults of
the controller its output.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.electronics.amplifier import (
    Amplifier,
    Flow,
    advance_open_short,
    amplifier,
    drive_coils,
    reset_sums,
    with_supply,
    zero_flow,
)
from spheretwin.electronics.coil import (
    DRIVEN,
    OPEN,
    SHORTED,
    CurrentLag,
    GroupCoils,
    advance_lag,
    advance_temperature,
    back_emf,
    current_lag,
    group_coils,
    is_overheated,
    update_resistance,
)
from spheretwin.electronics.coil_coupling import (
    MOST_SWEEPS,
    Coupling,
    coupling,
    induce_voltages,
    predict_changes,
    update_changes,
)
from spheretwin.electronics.delay import Delay, delay, due, latch
from spheretwin.electronics.drive_section import STAGES, ResolvedDrive
from spheretwin.electronics.stages import DriveSetup, FaultLine, chained, fault_line, through
from spheretwin.models.base.compiled import copy_into, implements, inlined
from spheretwin.models.base.state import transfer_state
from spheretwin.models.kinematics import angular_velocity

Array = NDArray[np.float64]

NORMAL, STUCK, SILENT = 0, 1, 2
"""Output of the controller: its commands, only its last command, or nothing."""

RELEASED, BRAKED = 1, 2
"""Requests of a watchdog: no currents, or shorted coils."""

_NAMES = tuple(STAGES)
_convert = chained([kind.convert() for kind in STAGES.values()])
_advance = chained([kind.advance() for kind in STAGES.values()])


class ControllerOutput(NamedTuple):
    """Output of the controller, which faults and a watchdog act on."""

    state: NDArray[np.int64]  # (1,) `NORMAL`, `STUCK` or `SILENT`
    delay_steps: NDArray[np.int64]  # (1,) additional delay in physics steps
    halt: NDArray[np.int64]  # (1,) request of a watchdog

    def fault_arrays(self) -> tuple[NDArray[Any], ...]:
        """Return the arrays that faults write."""
        return self.state, self.delay_steps


class DriveChain(NamedTuple):
    """All stages of the drive, for compiled code."""

    converts: bool  # true if the setpoint can differ from the command
    supplied: bool  # true if the amplifiers have a supply, and the coils a voltage
    supply_V: float
    lag: CurrentLag
    output: ControllerOutput
    stages: tuple[Any, ...]  # in the order of `STAGES`
    delay: Delay
    supply: FaultLine  # of the supply voltage
    amplifier: Amplifier
    coil: GroupCoils
    coupling: Coupling | None
    flow: Flow
    draws: Array  # standard normal numbers of this tick, of faults
    setpoint: Array  # (n,) A, command at the input of the amplifiers
    emf: Array  # (n,) V
    rate_S: Array  # (3,) rad/s of the rotor, stator frame
    period: (
        Array  # (3,) of this control period: charge drawn in As, supply in V, 1 for an open or shorted group
    )
    before: Array  # (5, n) current and sums of the groups at step start

    def stage(self, name: str) -> Any:
        """Return the stage of a name."""
        return self.stages[_NAMES.index(name)]


DRAWN_As, SUPPLY_V, OPEN_SHORT = 0, 1, 2
"""Places in `DriveChain.period`."""


class DriveFaults(NamedTuple):
    """Inputs of a drive chain with faults or a watchdog."""

    scheduled: bool
    """True if faults may occur; False if there is only a watchdog."""
    longest_delay_steps: int
    """Longest additional delay by faults, in physics steps."""
    halt: NDArray[np.int64]
    """(1,) written by a watchdog."""
    draws: Array
    """Random numbers of each tick, written by the loop."""


def drive_chain(
    section: ResolvedDrive,
    step_s: float,
    substeps: int,
    groups: int,
    seed: int,
    faults: DriveFaults | None = None,
    mutual_H: Array | None = None,
) -> DriveChain:
    """Return the drive chain at rest, with errors drawn from the seed.

    Parameters
    ----------
    section : ResolvedDrive
    step_s : float, s
        Physics step.
    substeps : int
        Physics steps in a control period.
    groups : int
    seed : int
        Seed of the run: the same seed gives the same prototype.
    faults : DriveFaults, optional
        None if nothing can fail.
    mutual_H : (n, n) array, H, optional
        Mutual inductance of the groups by the geometry; None without coupling.

    Raises
    ------
    ValueError
        The delay is not a whole number of physics steps.
    """
    command_delay = delay(section, step_s, substeps, groups)
    setup = DriveSetup(seed, step_s, groups, faults is not None and faults.scheduled)
    if faults:
        more = -(-faults.longest_delay_steps // substeps)
        command_delay = command_delay._replace(history=np.zeros((len(command_delay.history) + more, groups)))
    amplifiers = amplifier(section, section.current_limit_A, step_s, groups, seed)
    chain = DriveChain(
        converts=section.converts or faults is not None,
        supplied=section.supply_V is not None,
        supply_V=0.0 if section.supply_V is None else section.supply_V,
        lag=current_lag(section.lag_s, step_s, section.current_limit_A, groups),
        output=ControllerOutput(
            np.full(1, NORMAL), np.zeros(1, dtype=np.int64), faults.halt if faults else np.full(1, NORMAL)
        ),
        stages=tuple(kind.build(section, setup) for kind in STAGES.values()),
        delay=command_delay,
        supply=fault_line(1),
        amplifier=amplifiers,
        coil=group_coils(section, substeps * step_s, groups),
        coupling=coupling(section, mutual_H, amplifiers),
        flow=zero_flow(groups),
        draws=faults.draws if faults else np.empty(0),
        setpoint=np.zeros(groups),
        emf=np.zeros(groups),
        rate_S=np.zeros(3),
        period=np.zeros(3),
        before=np.zeros((5, groups)),
    )
    chain.period[SUPPLY_V] = chain.supply_V
    return chain


@inlined
def begin(chain: DriveChain, command: Array) -> None:
    """Accept the commands of a control period from the output of the controller, and reset the sums."""
    setpoint, output, period = chain.setpoint, chain.output, chain.period
    if chain.converts:
        if output.state[0] == STUCK:
            for j in range(setpoint.shape[0]):
                setpoint[j] = chain.delay.history[0, j]
        else:
            for j in range(setpoint.shape[0]):
                setpoint[j] = 0.0 if output.state[0] == SILENT else command[j]
            _convert(chain.stages, setpoint, chain.draws)
        latch(chain.delay, setpoint)
    reset_sums(chain.flow)
    period[DRAWN_As] = 0.0
    if chain.supplied:
        period[SUPPLY_V] = max(through(chain.supply, 0, chain.supply_V, chain.draws), 0.0)
    period[OPEN_SHORT] = 0.0
    for j in range(setpoint.shape[0]):
        if _contact(chain, j) != DRIVEN:
            period[OPEN_SHORT] = 1.0


@inlined
def advance(
    chain: DriveChain,
    command: Array,
    substep: int,
    q: Array,
    qdot: Array,
    G: Array,
    gain: Array,
    current: Array,
    mean: Array,
) -> None:
    """Advance the currents by one physics step.

    Parameters
    ----------
    chain : DriveChain
    command : (n,) array, A
        Commands of this control period.
    substep : int
        Physics step of the period, from 0.
    q, qdot : (3,) arrays, rad and rad/s
        Pose and rates for the back-EMF of the step.
    G : (3, n) array, N·m/A
        True torque matrix at this pose.
    gain : (n,) array
        Torque per ampere of each group over that of the matrix.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Result: mean over the step.
    """
    setpoint, any_open_short = chain.setpoint if chain.converts else command, chain.period[OPEN_SHORT] != 0.0
    if chain.converts:
        update_setpoint(chain, substep)
    if chain.supplied or any_open_short:
        angular_velocity(q, qdot, chain.rate_S)
        back_emf(G, gain, chain.rate_S, chain.emf)
    _advance_all_groups(chain.coupling, chain, setpoint, any_open_short, current, mean)
    if chain.supplied:
        _add_supply_charge(chain, setpoint, mean)


@inlined
def _advance_groups(
    chain: DriveChain,
    amplifier: Amplifier,
    setpoint: Array,
    any_open_short: bool,
    current: Array,
    mean: Array,
) -> None:
    """Advance the currents by the step of the amplifiers, with the present EMF."""
    if any_open_short:
        _save_groups(chain, current)
    if chain.supplied:
        drive_coils(amplifier, chain.coil, setpoint, chain.emf, current, chain.flow)
        for j in range(mean.shape[0]):
            mean[j] = chain.flow.mean_current_A[j]
    else:
        advance_lag(chain.lag, setpoint, current, mean)
    if any_open_short:
        _advance_open_short_groups(chain, amplifier.step_s, current, mean)


@inlined
def _advance_uncoupled_groups(
    coupling: None, chain: DriveChain, setpoint: Array, any_open_short: bool, current: Array, mean: Array
) -> None:
    """Advance the currents of groups without coupling by one physics step."""
    amplifier = with_supply(chain.amplifier, chain.period[SUPPLY_V] - chain.supply_V)
    _advance_groups(chain, amplifier, setpoint, any_open_short, current, mean)


@inlined
def _advance_coupled_groups(
    coupling: Coupling, chain: DriveChain, setpoint: Array, any_open_short: bool, current: Array, mean: Array
) -> None:
    """Advance the currents of coupled groups by one physics step, in two parts."""
    groups = current.shape[0]
    for j in range(groups):
        coupling.own_emf[j], coupling.charge_As[j] = chain.emf[j], 0.0
    for part in range(len(coupling.amplifiers)):
        amplifier = with_supply(coupling.amplifiers[part], chain.period[SUPPLY_V] - chain.supply_V)
        _save_groups(chain, current)
        predict_changes(coupling, amplifier, chain.coil, setpoint, current)
        for _ in range(MOST_SWEEPS):
            induce_voltages(coupling, amplifier.step_s, chain.emf)
            for j in range(groups):
                _restore_group(chain, j, current)
            _advance_groups(chain, amplifier, setpoint, any_open_short, current, mean)
            if update_changes(coupling, chain.before[0], current):
                break
        for j in range(groups):
            coupling.charge_As[j] += amplifier.step_s * mean[j]
    for j in range(groups):
        mean[j] = coupling.charge_As[j] / chain.amplifier.step_s


def _advance_all_groups(
    coupling: Coupling | None,
    chain: DriveChain,
    setpoint: Array,
    any_open_short: bool,
    current: Array,
    mean: Array,
) -> None:
    """Advance the currents by one physics step; only the code that a run needs is compiled."""
    advance_all: Any = _advance_coupled_groups if coupling else _advance_uncoupled_groups
    advance_all(coupling, chain, setpoint, any_open_short, current, mean)


@implements(_advance_all_groups, inline=True)
def _compiled_advance_all(
    coupling: Any, chain: Any, setpoint: Any, any_open_short: Any, current: Any, mean: Any
) -> Callable[..., Any]:
    implementation = (
        _advance_coupled_groups if hasattr(coupling, "instance_class") else _advance_uncoupled_groups
    )

    def call(coupling: Any, chain: Any, setpoint: Any, any_open_short: Any, current: Any, mean: Any) -> None:
        implementation(coupling, chain, setpoint, any_open_short, current, mean)

    return call


@inlined
def update_setpoint(chain: DriveChain, substep: int) -> None:
    """Compute the setpoint of the amplifiers for a physics step."""
    setpoint, fixed, output = chain.setpoint, chain.delay, chain.output
    due(
        Delay(fixed.history, fixed.steps + output.delay_steps[0], fixed.substeps),
        substep,
        setpoint,
    )
    if output.halt[0] != NORMAL:
        for j in range(setpoint.shape[0]):
            setpoint[j] = 0.0
    _advance(chain.stages, setpoint, chain.draws)


@inlined
def _add_supply_charge(chain: DriveChain, setpoint: Array, mean: Array) -> None:
    """Add the charge that the amplifiers draw from the supply in a physics step."""
    amplifier, period = chain.amplifier, chain.period
    for j in range(mean.shape[0]):
        drawn = mean[j]
        if period[OPEN_SHORT] != 0.0 and _contact(chain, j) == SHORTED:
            # The current that circulates in the coil is not drawn; the amplifier drives its target.
            limit = amplifier.current_limit_A
            drawn = min(max(setpoint[j] + amplifier.offset_A[j], -limit), limit)
        period[DRAWN_As] += abs(drawn) * amplifier.step_s


@inlined
def _save_groups(chain: DriveChain, current: Array) -> None:
    """Save currents and sums of all groups at the start of the step."""
    flow, before = chain.flow, chain.before
    for j in range(current.shape[0]):
        before[0, j], before[1, j], before[2, j] = current[j], flow.copper_J[j], flow.work_J[j]
        before[3, j], before[4, j] = flow.voltage_limited_s[j], flow.current_limited_s[j]


@inlined
def _restore_group(chain: DriveChain, j: int, current: Array) -> None:
    """Restore current and sums of a group to the start of the step."""
    flow, before = chain.flow, chain.before
    current[j], flow.copper_J[j], flow.work_J[j] = before[0, j], before[1, j], before[2, j]
    flow.voltage_limited_s[j], flow.current_limited_s[j] = before[3, j], before[4, j]


@inlined
def _advance_open_short_groups(chain: DriveChain, step_s: float, current: Array, mean: Array) -> None:
    """Restore the open and shorted groups to the start of the step, and advance them without amplifiers."""
    for j in range(current.shape[0]):
        contact = _contact(chain, j)
        if contact != DRIVEN:
            _restore_group(chain, j, current)
            advance_open_short(contact, chain.coil, j, step_s, chain.emf[j], current, mean, chain.flow)


@inlined
def _contact(chain: DriveChain, group: int) -> int:
    """Return the connection of a group: a brake shorts all groups that are not open."""
    contact = chain.coil.contact[group]
    return SHORTED if contact != OPEN and chain.output.halt[0] == BRAKED else contact


@inlined
def end(chain: DriveChain) -> bool:
    """End a control period: advance the temperatures; return True if no coil is too hot."""
    if chain.supplied:
        advance_temperature(chain.coil, chain.flow.copper_J)
        return not is_overheated(chain.coil)
    return True


@inlined
def write_telemetry(chain: DriveChain, row: Array) -> None:
    """Write power, losses, temperatures and limits of the control period into the beginning of `row`."""
    flow, per_s, groups = chain.flow, 1.0 / chain.coil.period_s, chain.emf.shape[0]
    row[0] = chain.period[SUPPLY_V] * chain.period[DRAWN_As] * per_s
    _write_scaled(flow.work_J, per_s, row, 1)
    _write_scaled(flow.copper_J, per_s, row, 1 + groups)
    copy_into(row, 1 + 2 * groups, chain.coil.temperature_degC, groups)
    _write_scaled(flow.voltage_limited_s, per_s, row, 1 + 3 * groups)
    _write_scaled(flow.current_limited_s, per_s, row, 1 + 4 * groups)


@inlined
def _write_scaled(values: Array, factor: float, row: Array, first: int) -> None:
    for j in range(values.shape[0]):
        row[first + j] = values[j] * factor


def transfer(before: DriveChain | None, after: DriveChain, command: Array) -> None:
    """Transfer the state to a chain with other parameters.

    Parameters
    ----------
    before : DriveChain or None
        None for a `LagDrive`, which stores no commands.
    after : DriveChain
        Chain without a fault.
    command : (n,) array, A
        Last command.
    """
    if before is None:
        after.delay.history[:] = command
    else:
        transfer_state(before.delay, after.delay)
    if after.converts:  # the stored values are those that this chain would have had
        update_setpoint(after, after.delay.substeps - 1)
    if before is not None:
        transfer_state(before, after)
        update_resistance(after.coil)
