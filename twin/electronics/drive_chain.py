"""From commands to currents: the stages of all groups, one after the other, over a control period.

Once a control tick the stages convert the command, which is then delayed. At each physics step the command
in force passes the stages again, and is what the amplifiers are asked for. A fault modifies a stage, by its
fault line or by a field of its own. Faults of converters and amplifiers act behind the delay, where a
converter latches. Faults of the coils change how they are connected, those of the supply its voltage, those
of the controller its output.
"""

from __future__ import annotations

from math import exp, expm1
from typing import Annotated, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from spheretwin.control.law import Positive
from spheretwin.electronics.amplifier import (
    Amplifier,
    AmplifierSection,
    Flow,
    advance_open_short,
    amplifier,
    drive_coils,
    reset_sums,
    zero_flow,
)
from spheretwin.electronics.coil import (
    DRIVEN,
    OPEN,
    SHORTED,
    CoilSection,
    GroupCoils,
    advance_temperature,
    back_emf,
    group_coils,
    is_overheated,
    update_resistance,
)
from spheretwin.electronics.converters import DacSection
from spheretwin.electronics.delay import Delay, DelaySection, delay, due, latch, transfer_delay
from spheretwin.electronics.drive_stage import DriveSetup, DriveStage
from spheretwin.electronics.stages import FaultLine, chained, fault_line, through
from spheretwin.models.base.compiled import allocation_free, part_of_its_caller, transfer_state
from spheretwin.models.kinematics import angular_velocity


class DriveSection(DelaySection, DacSection, AmplifierSection, CoilSection):
    """From commands to currents; each stage is ideal until told otherwise, and the coils are the model's.

    Its bases that are a `DriveStage` are the list of the stages, in the order in which commands pass them.
    """

    time_constant_s: Annotated[float, Field(ge=0, le=1e3)] | None = Field(
        None, description="current lag L/R, s; 0 for none; of amplifiers without a supply"
    )
    current_limit_A: Positive | None = Field(None, description="largest group current of the amplifiers, A")

    @model_validator(mode="after")
    def _one_lag(self) -> DriveSection:
        if self.supply_V is not None and self.time_constant_s is not None:
            raise ValueError(
                "expected either a supply_V, whose amplifiers have a bandwidth, or a time_constant_s,"
                f" received {self.supply_V!r} V and {self.time_constant_s!r} s"
            )
        return self

    @property
    def converts(self) -> bool:
        """True if what is asked of the amplifiers is other than the command."""
        return self.delay_s > 0 or not all(kind.ideal(self) for kind in STAGES.values())


STAGES: dict[str, type[DriveStage]] = {
    kind.stage: kind for kind in DriveSection.__bases__ if issubclass(kind, DriveStage)
}
"""Kinds of the stages of the commands by their names, in the order in which the commands pass them."""


class ResolvedDrive(DriveSection):
    """Drive of a run: coils and limit are given, and the lag where there is no supply."""

    resistance_ohm: Positive
    inductance_H: Positive
    current_limit_A: Positive

    @property
    def lag_s(self) -> float:
        """Lag of the currents while no voltage is at its limit."""
        return cast("float", self.time_constant_s) if self.supply_V is None else 1 / self.bandwidth_rad_s


class CurrentLag(NamedTuple):
    """First-order lag, solved exactly over one physics step with the command held."""

    decay: float
    """Share of the distance to the command that is left after a step."""
    mean_share: float
    """Share of that distance that is left on average over the step."""
    current_limit_A: float
    """Of the amplifiers, whatever is asked of them."""


def current_lag(time_constant_s: float, step_s: float, current_limit_A: float) -> CurrentLag:
    """Drive for a time constant L/R (s; 0 for ideal amplifiers), a physics step (s) and a limit (A)."""
    if time_constant_s == 0:
        return CurrentLag(0.0, 0.0, current_limit_A)
    steps = step_s / time_constant_s
    return CurrentLag(exp(-steps), -expm1(-steps) / steps, current_limit_A)


@allocation_free
def advance_lag(
    lag: CurrentLag,
    command: NDArray[np.float64],
    current: NDArray[np.float64],
    mean: NDArray[np.float64],
) -> None:
    """Advance the currents by one physics step.

    Parameters
    ----------
    lag : CurrentLag
        Lag of the groups.
    command : (n,) array, A
        Held over the step; the amplifiers follow it as far as their limit.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Mean over the step, which is what acts on the rotor.
    """
    limit = lag.current_limit_A
    for j in range(command.shape[0]):
        target = min(max(command[j], -limit), limit)
        distance = current[j] - target
        mean[j] = target + lag.mean_share * distance
        current[j] = target + lag.decay * distance


Array = NDArray[np.float64]

NORMAL, STUCK, SILENT = 0, 1, 2
"""What leaves the controller: its commands, its last one for ever, or nothing."""

RELEASED, BRAKED = 1, 2
"""What a watchdog may have told: no currents, or shorted coils."""

_NAMES = tuple(STAGES)
_convert = chained([kind.convert() for kind in STAGES.values()])
_advance = chained([kind.advance() for kind in STAGES.values()])


class ControllerOutput(NamedTuple):
    """Output of the controller, which faults and a watchdog act on."""

    state: NDArray[np.int64]  # (1,) `NORMAL`, `STUCK` or `SILENT`
    delay_steps: NDArray[np.int64]  # (1,) physics steps more of delay
    halt: NDArray[np.int64]  # (1,) a watchdog's

    def fault_arrays(self) -> tuple[NDArray[Any], ...]:
        """Arrays that faults write."""
        return self.state, self.delay_steps


class DriveChain(NamedTuple):
    """All stages, for compiled code."""

    converts: bool  # whether what is asked of the amplifiers is other than the command
    supplied: bool  # whether the amplifiers have a supply, and the coils a voltage
    supply_V: float
    lag: CurrentLag
    output: ControllerOutput
    stages: tuple[Any, ...]  # in the order of `STAGES`
    delay: Delay
    supply: FaultLine  # of its voltage
    amplifier: Amplifier
    coil: GroupCoils
    flow: Flow
    draws: Array  # standard normal numbers of this tick, of faults
    setpoint: Array  # (n,) A of the amplifiers
    emf: Array  # (n,) V
    rate_S: Array  # (3,) rad/s of the rotor, stator frame
    period: Array  # (3,) of this control period: charge drawn in As, supply in V, 1 if a group is not driven
    before: Array  # (5, n) current and sums of undriven groups at the start of a step

    def stage(self, name: str) -> Any:
        """Stage of a name."""
        return self.stages[_NAMES.index(name)]


DRAWN_As, SUPPLY_V, OPEN_SHORT = 0, 1, 2
"""Places in `DriveChain.period`."""


class DriveFaults(NamedTuple):
    """What a chain needs if faults may come, or a watchdog."""

    planned: bool
    """True if faults may come, not a watchdog alone."""
    most_late_steps: int
    """Physics steps that faults may delay a command by."""
    halt: NDArray[np.int64]
    """(1,) a watchdog writes into it."""
    draws: Array
    """The loop writes the random numbers of each tick into it."""


def drive_chain(
    section: ResolvedDrive,
    step_s: float,
    substeps: int,
    groups: int,
    seed: int,
    faults: DriveFaults | None = None,
) -> DriveChain:
    """Stages at rest, with errors of their own.

    Parameters
    ----------
    section : ResolvedDrive
    step_s : float, s
        Physics step.
    substeps : int
        Physics steps in a control period.
    groups : int
    seed : int
        Of the run: the same prototype for the same seed.
    faults : DriveFaults, optional
        None if nothing can fail.

    Raises
    ------
    ValueError
        The delay is no whole number of physics steps.
    """
    late, planned = delay(section, step_s, substeps, groups), faults is not None and faults.planned
    setup = DriveSetup(seed, step_s, groups, planned)
    if faults:
        more = -(-faults.most_late_steps // substeps)
        late = late._replace(ring=np.zeros((len(late.ring) + more, groups)))
    chain = DriveChain(
        converts=section.converts or faults is not None,
        supplied=section.supply_V is not None,
        supply_V=0.0 if section.supply_V is None else section.supply_V,
        lag=current_lag(section.lag_s, step_s, section.current_limit_A),
        output=ControllerOutput(
            np.full(1, NORMAL), np.zeros(1, dtype=np.int64), faults.halt if faults else np.full(1, NORMAL)
        ),
        stages=tuple(kind.build(section, setup) for kind in STAGES.values()),
        delay=late,
        supply=fault_line(1),
        amplifier=amplifier(section, section.current_limit_A, step_s, groups, seed),
        coil=group_coils(section, section.resistance_ohm, section.inductance_H, substeps * step_s, groups),
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


@part_of_its_caller
def begin(chain: DriveChain, command: Array) -> None:
    """Take the commands of a control period, as far as they leave the controller, and begin its sums."""
    setpoint, output, period = chain.setpoint, chain.output, chain.period
    if chain.converts:
        if output.state[0] == STUCK:
            for j in range(setpoint.shape[0]):
                setpoint[j] = chain.delay.ring[chain.delay.newest[0], j]
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


@part_of_its_caller
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
        Of this control period.
    substep : int
        Physics step of the period, from 0.
    q, qdot : (3,) arrays, rad and rad/s
        That the back-EMF of the step is taken at.
    G : (3, n) array, N·m/A
        True torque matrix there.
    gain : (n,) array
        Of each group, over that matrix.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Result: over the step.
    """
    setpoint, any_open_short = chain.setpoint if chain.converts else command, chain.period[OPEN_SHORT] != 0.0
    if chain.converts:
        update_setpoint(chain, substep)
    if chain.supplied or any_open_short:
        angular_velocity(q, qdot, chain.rate_S)
        back_emf(G, gain, chain.rate_S, chain.emf)
    if any_open_short:
        _save_open_short_groups(chain, current)
    if chain.supplied:
        drive_coils(_amplifier_on_supply(chain), chain.coil, setpoint, chain.emf, current, chain.flow)
        for j in range(mean.shape[0]):
            mean[j] = chain.flow.mean_current_A[j]
    else:
        advance_lag(chain.lag, setpoint, current, mean)
    if any_open_short:
        _advance_open_short_groups(chain, current, mean)
    if chain.supplied:
        _add_supply_charge(chain, setpoint, mean)


@part_of_its_caller
def update_setpoint(chain: DriveChain, substep: int) -> None:
    """Write what the amplifiers are asked for in a physics step."""
    setpoint, late, output = chain.setpoint, chain.delay, chain.output
    due(Delay(late.ring, late.newest, late.steps + output.delay_steps[0], late.substeps), substep, setpoint)
    if output.halt[0] != NORMAL:
        for j in range(setpoint.shape[0]):
            setpoint[j] = 0.0
    _advance(chain.stages, setpoint, chain.draws)


@part_of_its_caller
def _amplifier_on_supply(chain: DriveChain) -> Amplifier:
    """Amplifiers on the supply of this period, whose swing is 0 if the drops take all of it."""
    amplifier, more_V = chain.amplifier, chain.period[SUPPLY_V] - chain.supply_V
    if more_V == 0.0:
        return amplifier
    return Amplifier(
        amplifier.supplied,
        max(amplifier.highest_V + more_V, 0.0),
        min(amplifier.lowest_V - more_V, 0.0),
        amplifier.bandwidth_rad_s,
        amplifier.current_limit_A,
        amplifier.step_s,
        amplifier.following,
        amplifier.offset_A,
    )


@part_of_its_caller
def _add_supply_charge(chain: DriveChain, setpoint: Array, mean: Array) -> None:
    """Add what the amplifiers draw from the supply in a physics step."""
    amplifier, period = chain.amplifier, chain.period
    for j in range(mean.shape[0]):
        drawn = mean[j]
        if period[OPEN_SHORT] != 0.0 and _contact(chain, j) == SHORTED:
            # What turns in the coil is not the supply's; past it, the amplifier drives what it is asked.
            limit = amplifier.current_limit_A
            drawn = min(max(setpoint[j] + amplifier.offset_A[j], -limit), limit)
        period[DRAWN_As] += abs(drawn) * amplifier.step_s


@part_of_its_caller
def _save_open_short_groups(chain: DriveChain, current: Array) -> None:
    """Keep currents and sums of the groups that no amplifier drives, before all are driven."""
    flow, before = chain.flow, chain.before
    for j in range(current.shape[0]):
        if _contact(chain, j) != DRIVEN:
            before[0, j], before[1, j], before[2, j] = current[j], flow.copper_J[j], flow.work_J[j]
            before[3, j], before[4, j] = flow.voltage_limited_s[j], flow.current_limited_s[j]


@part_of_its_caller
def _advance_open_short_groups(chain: DriveChain, current: Array, mean: Array) -> None:
    """Undo what driving has done to the groups that no amplifier drives, and advance them by themselves."""
    flow, before = chain.flow, chain.before
    for j in range(current.shape[0]):
        contact = _contact(chain, j)
        if contact != DRIVEN:
            current[j], flow.copper_J[j], flow.work_J[j] = before[0, j], before[1, j], before[2, j]
            flow.voltage_limited_s[j], flow.current_limited_s[j] = before[3, j], before[4, j]
            advance_open_short(
                contact, chain.coil, j, chain.amplifier.step_s, chain.emf[j], current, mean, flow
            )


@part_of_its_caller
def _contact(chain: DriveChain, group: int) -> int:
    """How a group is connected: a brake shorts all that are not open."""
    contact = chain.coil.contact[group]
    return SHORTED if contact != OPEN and chain.output.halt[0] == BRAKED else contact


@part_of_its_caller
def end(chain: DriveChain) -> bool:
    """End a control period: the coils have warmed by what they lost; returns whether none is too hot."""
    if chain.supplied:
        advance_temperature(chain.coil, chain.flow.copper_J)
        return not is_overheated(chain.coil)
    return True


@part_of_its_caller
def write_telemetry(chain: DriveChain, row: Array) -> None:
    """Write power, losses, temperatures and limits of the control period into the beginning of `row`."""
    flow, period_s, groups = chain.flow, chain.coil.period_s, chain.emf.shape[0]
    row[0] = chain.period[SUPPLY_V] * chain.period[DRAWN_As] / period_s
    for j in range(groups):
        row[1 + j] = flow.work_J[j] / period_s
        row[1 + groups + j] = flow.copper_J[j] / period_s
        row[1 + 2 * groups + j] = chain.coil.temperature_degC[j]
        row[1 + 3 * groups + j] = flow.voltage_limited_s[j] / period_s
        row[1 + 4 * groups + j] = flow.current_limited_s[j] / period_s


def transfer(before: DriveChain | None, after: DriveChain, command: Array) -> None:
    """Go on as before with other figures.

    Parameters
    ----------
    before : DriveChain or None
        None for amplifiers right behind their commands, of which they kept none.
    after : DriveChain
        Without a fault.
    command : (n,) array, A
        The last one.
    """
    if before is None:
        after.delay.ring[:] = command
    else:
        transfer_delay(before.delay, after.delay)
        after.coil.temperature_degC[:] = before.coil.temperature_degC
        update_resistance(after.coil)
    if after.converts:  # what is held from now on is what it would have been
        update_setpoint(after, after.delay.substeps - 1)
    for was, now in zip(before.stages if before else after.stages, after.stages, strict=True):
        if was.on and now.on:
            transfer_state(was, now)
