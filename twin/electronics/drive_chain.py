"""Drive chain: the stages from commands to currents of all groups, over a control period.

Once in each control tick the stages convert the command, which is then delayed. At each physics step the
active command passes the stages again and becomes the setpoint of the amplifiers. A fault modifies a stage,
by its fault line or by another field. Faults of converters and amplifiers act after the delay, where a
converter latches. Faults of the coils change their connection, faults of the supply its voltage, faults of
the controller its output.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from spheretwin.electronics.amplifier import (
    Amplifier,
    Flow,
    Step,
    advance_open_short,
    drive_coils,
    fill_amplifier,
    reset_sums,
    set_supply,
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
    fill_coils,
    fill_lag,
    is_overheated,
    update_resistance,
)
from spheretwin.electronics.coil_coupling import (
    MOST_SWEEPS,
    Coupling,
    fill_coupling,
    induce_voltages,
    predict_changes,
    update_changes,
)
from spheretwin.electronics.delay import Delay, due, latch, steps_of, stored_commands
from spheretwin.electronics.drive_section import STAGES, ResolvedDrive
from spheretwin.electronics.stages import DriveSetup, FaultLine, chained, fill_fault_line, through
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, copy_into, inlined
from spheretwin.models.base.record import Record, Rows, capacity, field, put, record_of, transfer_rows
from spheretwin.models.kinematics import angular_velocity

NORMAL, STUCK, SILENT = 0, 1, 2
"""Output of the controller: its commands, only its last command, or nothing."""

RELEASED, BRAKED = 1, 2
"""Requests of a watchdog: no currents, or shorted coils."""

DriveStages = record_of("DriveStages", "Stages of the drive.", {n: kind.record for n, kind in STAGES.items()})
_convert = chained({name: kind.convert() for name, kind in STAGES.items()})
_advance = chained({name: kind.advance() for name, kind in STAGES.items()})


class ControllerOutput(Record):
    """Output of the controller, which faults and a watchdog act on."""

    state: int = field("`NORMAL`, `STUCK` or `SILENT`", fault=True)
    delay_steps: int = field("additional delay", "physics steps", fault=True)
    halt: int = field("request of a watchdog in this control period")


class Period(Record):
    """Quantities of a control period."""

    drawn_As: float = field("charge drawn from the supply", "As")
    supply_V: float = field("supply", "V")
    any_open_short: bool = field("whether a group is open or shorted")


class DriveChain(Record):
    """All stages of the drive."""

    converts: bool = field("whether the setpoint can differ from the command")
    supplied: bool = field("whether the amplifiers have a supply, and the coils a voltage")
    supply_V: float = field("supply without a fault; 0 without one", "V")
    lag: CurrentLag = field("current lag of amplifiers without a supply")
    output: ControllerOutput = field("output of the controller")
    stages: Any = field("in the order of `STAGES`", family=DriveStages)
    delay: Delay = field("delay of the commands")
    supply: FaultLine = field("of the supply voltage", channels=1)
    amplifier: Amplifier = field("amplifiers")
    coil: GroupCoils = field("coils")
    coupling: Coupling = field("coupling of the groups")
    flow: Flow = field("currents and energies")
    setpoint: Array = field("command at the input of the amplifiers", "A", "groups")
    emf: Array = field("back-EMF", "V", "groups")
    rate_S: Array = field("angular velocity of the rotor, stator frame", "rad/s", 3)
    period: Period = field("of this control period")
    before: Array = field("current and sums of the groups at step start", "", (5, "groups"))


def stored_delays(section: ResolvedDrive, step_s: float, substeps: int, longest_delay_steps: int = 0) -> int:
    """Return the commands that a drive stores, at the longest delay with additional physics steps by faults.

    Raises
    ------
    ValueError
        The delay is not a whole number of physics steps.
    """
    steps = steps_of(section, step_s, substeps) + longest_delay_steps
    return capacity(int(np.max(stored_commands(steps, substeps))))


def fill_drive(
    rows: Rows,
    section: ResolvedDrive,
    step_s: float,
    substeps: int,
    seed: int,
    faulty: bool = False,
    halts: bool = False,
    mutual_H: Array | None = None,
) -> None:
    """Fill drives at rest, with errors drawn from the seed.

    Numbers and switches that differ between rows are (rows, 1) arrays.

    Parameters
    ----------
    rows : array of DriveChain
        In which all numbers are 0.
    section : ResolvedDrive
        Of all rows, or the `Columns` of their sections.
    step_s : float, s
        Physics step.
    substeps : int
        Physics steps in a control period.
    seed : int
        Seed of the run: the same seed gives the same prototype.
    faulty : bool
        Whether faults may occur.
    halts : bool
        Whether a watchdog may halt the drive.
    mutual_H : (n, n) array, H, optional
        Mutual inductance of the groups by the geometry; None without coupling in any row.
    """
    setup = DriveSetup(seed, faulty)
    supplied = section.supply_V is not None
    supply_V = section.supply_V if supplied else 0.0
    put(rows, converts=section.converts | faulty | halts, supplied=supplied, supply_V=supply_V)
    put(rows["period"], supply_V=supply_V)
    fill_lag(rows["lag"], section.lag_s, step_s, section.current_limit_A)
    for name, kind in STAGES.items():
        kind.fill(rows["stages"][name], section, setup)
    put(rows["delay"], steps=steps_of(section, step_s, substeps), substeps=substeps)
    fill_fault_line(rows["supply"])
    fill_amplifier(rows["amplifier"], section, section.current_limit_A, step_s, seed)
    fill_coils(rows["coil"], section, substeps * step_s)
    if mutual_H is not None:
        fill_coupling(rows["coupling"], section, mutual_H, step_s)


@inlined
def begin(chain: DriveChain, command: Array, halt: int, draws: Array) -> None:
    """Accept the commands of a control period from the output of the controller, and reset the sums.

    Parameters
    ----------
    chain : DriveChain
    command : (n,) array, A
    halt : int
        Request of a watchdog.
    draws : array
        Standard normal numbers of this tick, of faults.
    """
    setpoint, output, period = chain.setpoint, chain.output, chain.period
    output.halt, period.drawn_As, period.any_open_short = halt, 0.0, False
    for j in range(setpoint.shape[0]):
        setpoint[j] = command[j]
    if chain.converts:
        if output.state == STUCK:
            for j in range(setpoint.shape[0]):
                setpoint[j] = chain.delay.history[0, j]
        else:
            if output.state == SILENT:
                for j in range(setpoint.shape[0]):
                    setpoint[j] = 0.0
            _convert(chain.stages, setpoint, draws)
        latch(chain.delay, setpoint)
    for j in range(setpoint.shape[0]):
        if _contact(chain, j) != DRIVEN:
            period.any_open_short = True
    if chain.supplied:
        period.supply_V = max(through(chain.supply, 0, chain.supply_V, draws), 0.0)
        set_supply(chain.amplifier, period.supply_V)
    if chain.supplied or period.any_open_short:
        reset_sums(chain.flow)


@inlined
def advance(
    chain: DriveChain,
    substep: int,
    q: Array,
    qdot: Array,
    G: Array,
    gain: Array,
    draws: Array,
    current: Array,
    mean: Array,
) -> None:
    """Advance the currents by one physics step.

    Parameters
    ----------
    chain : DriveChain
        After `begin` of this control period.
    substep : int
        Physics step of the period, from 0.
    q, qdot : (3,) arrays, rad and rad/s
        Pose and rates for the back-EMF of the step.
    G : (3, n) array, N·m/A
        True torque matrix at this pose.
    gain : (n,) array
        Torque per ampere of each group over that of the matrix.
    draws : array
        Standard normal numbers of this tick, of faults.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Result: mean over the step.
    """
    if chain.converts:
        update_setpoint(chain, substep, draws)
    if chain.supplied or chain.period.any_open_short:
        angular_velocity(q, qdot, chain.rate_S)
        back_emf(G, gain, chain.rate_S, chain.emf)
    if chain.coupling.on:
        _advance_coupled_groups(chain, current, mean)
    else:
        _advance_groups(chain, chain.amplifier.whole, current, mean)
    if chain.supplied:
        _add_supply_charge(chain, mean)


@inlined
def _advance_groups(chain: DriveChain, step: Step, current: Array, mean: Array) -> None:
    """Advance the currents by a step of the amplifiers, with the present EMF."""
    any_open_short, flow = chain.period.any_open_short, chain.flow
    if any_open_short:
        _save_groups(chain, current)
    if chain.supplied:
        drive_coils(chain.amplifier, step, chain.coil, chain.setpoint, chain.emf, current, flow)
        for j in range(mean.shape[0]):
            mean[j] = flow.mean_current_A[j]
    else:
        advance_lag(chain.lag, chain.setpoint, current, mean)
    if any_open_short:
        _advance_open_short_groups(chain, step.step_s, current, mean)


@allocation_free  # its own copy of the step of the groups
def _advance_coupled_groups(chain: DriveChain, current: Array, mean: Array) -> None:
    """Advance the currents of coupled groups by one physics step, in two parts."""
    groups, coupling = current.shape[0], chain.coupling
    for j in range(groups):
        coupling.own_emf[j], coupling.charge_As[j] = chain.emf[j], 0.0
    for part in range(2):
        step = coupling.parts[part]
        _save_groups(chain, current)
        predict_changes(coupling, chain.amplifier, step, chain.coil, chain.setpoint, current)
        for _ in range(MOST_SWEEPS):
            induce_voltages(coupling, step.step_s, chain.emf)
            for j in range(groups):
                _restore_group(chain, j, current)
            _advance_groups(chain, step, current, mean)
            if update_changes(coupling, chain.before[0], current):
                break
        for j in range(groups):
            coupling.charge_As[j] += step.step_s * mean[j]
    for j in range(groups):
        mean[j] = coupling.charge_As[j] / chain.amplifier.whole.step_s


@inlined
def update_setpoint(chain: DriveChain, substep: int, draws: Array) -> None:
    """Compute the setpoint of the amplifiers for a physics step."""
    setpoint, output = chain.setpoint, chain.output
    due(chain.delay, output.delay_steps, substep, setpoint)
    if output.halt != NORMAL:
        for j in range(setpoint.shape[0]):
            setpoint[j] = 0.0
    _advance(chain.stages, setpoint, draws)


@inlined
def _add_supply_charge(chain: DriveChain, mean: Array) -> None:
    """Add the charge that the amplifiers draw from the supply in a physics step."""
    amplifier, period = chain.amplifier, chain.period
    for j in range(mean.shape[0]):
        drawn = mean[j]
        if period.any_open_short and _contact(chain, j) == SHORTED:
            # The current that circulates in the coil is not drawn; the amplifier drives its target.
            limit = amplifier.current_limit_A
            drawn = min(max(chain.setpoint[j] + amplifier.offset_A[j], -limit), limit)
        period.drawn_As += abs(drawn) * amplifier.whole.step_s


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
    return SHORTED if contact != OPEN and chain.output.halt == BRAKED else contact


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
    row[0] = chain.period.supply_V * chain.period.drawn_As * per_s
    _write_scaled(flow.work_J, per_s, row, 1)
    _write_scaled(flow.copper_J, per_s, row, 1 + groups)
    copy_into(row, 1 + 2 * groups, chain.coil.temperature_degC, groups)
    _write_scaled(flow.voltage_limited_s, per_s, row, 1 + 3 * groups)
    _write_scaled(flow.current_limited_s, per_s, row, 1 + 4 * groups)


@inlined
def _write_scaled(values: Array, factor: float, row: Array, first: int) -> None:
    for j in range(values.shape[0]):
        row[first + j] = values[j] * factor


def transfer_drive(before: Rows, after: Rows, command: Array) -> None:
    """Transfer the state to a drive with other parameters, without a fault.

    Parameters
    ----------
    before, after : arrays of DriveChain
    command : (n,) array, A
        Last command.
    """
    ideal = not (before["converts"].any() or before["supplied"].any())  # it stores no commands
    if ideal:
        after["delay"]["history"] = command
    else:
        transfer_rows(before["delay"], after["delay"])
    for chain in after:
        if chain.converts:  # the stored values are those that this drive would have had
            update_setpoint(chain, chain.delay.substeps - 1, np.zeros(0))
    if not ideal:
        transfer_rows(before, after)
        for chain in after:
            update_resistance(chain.coil)
