"""The stages from commands to currents with what is wrong with them; while nothing is, the same bits.

Faults of converters and amplifiers are one line a group, ``gain · asked + offset + noise``, or a value that
is held, and act behind the delay, where a converter latches. Those of the coils are how they are connected,
those of the supply its voltage, those of the controller what leaves it. None of them knows of a plan: what is
wrong now stands in `DriveFaults`, and is written between two control ticks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.kinematics import angular_velocity
from spheretwin.twin.electronics.driving import chain
from spheretwin.twin.electronics.driving.amplifier import Amplifier, clear, drive_coils
from spheretwin.twin.electronics.driving.chain import Driving
from spheretwin.twin.electronics.driving.coil import back_emf
from spheretwin.twin.electronics.driving.dac import convert
from spheretwin.twin.electronics.driving.delay import Delay, due, latch
from spheretwin.twin.electronics.driving.lag import advance as follow
from spheretwin.twin.electronics.driving.undriven import DRIVEN, OPEN, SHORTED, undriven

Array = NDArray[np.float64]

GOING, HANGING, SILENT = 0, 1, 2
"""What leaves the controller: its commands, its last one for ever, or nothing."""

RELEASED, BRAKED = 1, 2
"""What a watchdog may have told: no currents, or shorted coils."""

SOURCES = 2
"""Of noise a group: converter and amplifier."""


class DriveFaults(NamedTuple):
    """What is wrong now, for compiled code; all of it is written from outside but for the last rows."""

    acts: NDArray[np.bool_]  # (1,) whether anything is wrong
    gain: Array  # (n,) of what the amplifiers are asked for
    offset_A: Array  # (n,)
    noise_A: Array  # (n, SOURCES) rms
    column: NDArray[np.int64]  # (n, SOURCES) of the draws
    holds: NDArray[np.bool_]  # (n,) whether what is asked for stays what it was
    contact: NDArray[np.int64]  # (n,) `DRIVEN`, `OPEN` or `SHORTED`
    supply: Array  # (3,) gain, offset in V, noise in V rms
    supply_column: NDArray[np.int64]  # (1,) of the draws
    leaves: NDArray[np.int64]  # (1,) `GOING`, `HANGING` or `SILENT`
    late_steps: NDArray[np.int64]  # (1,) physics steps more of delay
    halt: NDArray[np.int64]  # (1,) a watchdog's
    draws: Array  # standard normal numbers of this tick
    added_A: Array  # (n,) offset and noise of this tick
    supply_V: Array  # (1,) of this tick
    last_A: Array  # (n,) asked for in the last physics step
    kept: Array  # (5, n) current and sums at the start of a step


class FaultyDriving(NamedTuple):
    """All stages and what is wrong with them, for compiled code."""

    driving: Driving
    faults: DriveFaults


def drive_faults(groups: int, halt: NDArray[np.int64], draws: Array) -> DriveFaults:
    """Nothing is wrong.

    Parameters
    ----------
    groups : int
    halt : (1,) array
        A watchdog writes into it.
    draws : array
        The loop writes the standard normal numbers of each tick into it.
    """
    made = DriveFaults(
        acts=np.zeros(1, dtype=np.bool_),
        gain=np.ones(groups),
        offset_A=np.zeros(groups),
        noise_A=np.zeros((groups, SOURCES)),
        column=np.zeros((groups, SOURCES), dtype=np.int64),
        holds=np.zeros(groups, dtype=np.bool_),
        contact=np.zeros(groups, dtype=np.int64),
        supply=np.zeros(3),
        supply_column=np.zeros(1, dtype=np.int64),
        leaves=np.zeros(1, dtype=np.int64),
        late_steps=np.zeros(1, dtype=np.int64),
        halt=halt,
        draws=draws,
        added_A=np.zeros(groups),
        supply_V=np.zeros(1),
        last_A=np.zeros(groups),
        kept=np.zeros((5, groups)),
    )
    heal(made)
    return made


def faulty_driving(driving: Driving, faults: DriveFaults, most_late_steps: int) -> FaultyDriving:
    """Stages with what may go wrong with them.

    Parameters
    ----------
    driving : Driving
        At rest.
    faults : DriveFaults
    most_late_steps : int
        Physics steps that a fault may delay a command by.
    """
    late = driving.delay
    more = -(-most_late_steps // late.substeps)
    ring = np.zeros((len(late.ring) + more, late.ring.shape[1]))
    return FaultyDriving(driving._replace(converts=True, delay=late._replace(ring=ring)), faults)


def heal(faults: DriveFaults) -> None:
    """Nothing is wrong any more; what is held is let go."""
    faults.acts[0] = False
    faults.gain[:], faults.offset_A[:], faults.noise_A[:], faults.holds[:] = 1.0, 0.0, 0.0, False
    faults.contact[:], faults.supply[:], faults.leaves[0] = DRIVEN, (1.0, 0.0, 0.0), GOING
    faults.late_steps[0] = 0


@part_of_its_caller
def begin(faulty: FaultyDriving, command: Array) -> None:
    """Take the commands of a control period, as far as they leave the controller, and begin its sums."""
    driving, faults = faulty.driving, faulty.faults
    groups = command.shape[0]
    if faults.leaves[0] == GOING:
        convert(driving.dac, command, driving.asked)
        latch(driving.delay, driving.asked)
    else:
        ring, newest = driving.delay.ring, driving.delay.newest[0]
        for j in range(groups):
            driving.asked[j] = ring[newest, j] if faults.leaves[0] == HANGING else 0.0
        if faults.leaves[0] == SILENT:
            convert(driving.dac, driving.asked, driving.asked)
        latch(driving.delay, driving.asked)
    if faults.acts[0]:
        for j in range(groups):
            faults.added_A[j] = faults.offset_A[j]
            for source in range(SOURCES):
                if faults.noise_A[j, source] > 0.0:
                    faults.added_A[j] += faults.noise_A[j, source] * faults.draws[faults.column[j, source]]
    clear(driving.flow)
    if driving.supplied:
        driving.drawn_As[0] = 0.0
        volts = faults.supply[0] * driving.supply_V + faults.supply[1]
        if faults.supply[2] > 0.0:
            volts += faults.supply[2] * faults.draws[faults.supply_column[0]]
        faults.supply_V[0] = max(volts, 0.0)


@part_of_its_caller
def advance(
    faulty: FaultyDriving,
    command: Array,
    substep: int,
    q: Array,
    qdot: Array,
    G: Array,
    gain: Array,
    current: Array,
    mean: Array,
) -> None:
    """Advance the currents by one physics step, as `chain.advance` does."""
    driving, faults = faulty.driving, faulty.faults
    _ask(faulty, substep)
    asked, wrong = driving.asked, faults.acts[0] or faults.halt[0] != GOING
    angular_velocity(q, qdot, driving.rate_S)
    back_emf(G, gain, driving.rate_S, driving.emf)
    if wrong:
        _keep(faulty, current)
    if driving.supplied:
        amplifier = driving.amplifier
        if wrong:
            amplifier = _with_supply(amplifier, faults.supply_V[0] - driving.supply_V)
        drive_coils(amplifier, driving.coil, asked, driving.emf, current, driving.flow)
        for j in range(mean.shape[0]):
            mean[j] = driving.flow.mean_current_A[j]
    else:
        follow(driving.lag, asked, current, mean)
    if wrong:
        _take_off(faulty, current, mean)
    if driving.supplied:
        for j in range(mean.shape[0]):
            drawn = mean[j]
            if wrong and _contact(faults, j) == SHORTED:
                # What turns in the coil is not the supply's; past it, the amplifier drives what it is asked.
                limit = driving.amplifier.current_limit_A
                drawn = min(max(asked[j] + driving.amplifier.offset_A[j], -limit), limit)
            driving.drawn_As[0] += abs(drawn) * driving.amplifier.step_s


@part_of_its_caller
def _ask(faulty: FaultyDriving, substep: int) -> None:
    """What the amplifiers are asked for in a physics step."""
    driving, faults = faulty.driving, faulty.faults
    asked, late = driving.asked, driving.delay
    if faults.late_steps[0] > 0:
        late = Delay(late.ring, late.newest, late.steps + faults.late_steps[0], late.substeps)
    due(late, substep, asked)
    if faults.halt[0] != GOING:
        for j in range(asked.shape[0]):
            asked[j] = 0.0
    if faults.acts[0]:
        for j in range(asked.shape[0]):
            asked[j] = faults.last_A[j] if faults.holds[j] else faults.gain[j] * asked[j] + faults.added_A[j]
    for j in range(asked.shape[0]):
        faults.last_A[j] = asked[j]


@part_of_its_caller
def _with_supply(amplifier: Amplifier, more_V: float) -> Amplifier:
    """Amplifiers on another supply: what of it is left to them, and nothing where that is less than none."""
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
def _keep(faulty: FaultyDriving, current: Array) -> None:
    """Keep currents and sums of the groups that no amplifier drives, before all are driven."""
    flow, kept = faulty.driving.flow, faulty.faults.kept
    for j in range(current.shape[0]):
        if _contact(faulty.faults, j) != DRIVEN:
            kept[0, j], kept[1, j], kept[2, j] = current[j], flow.copper_J[j], flow.work_J[j]
            kept[3, j], kept[4, j] = flow.voltage_limited_s[j], flow.current_limited_s[j]


@part_of_its_caller
def _take_off(faulty: FaultyDriving, current: Array, mean: Array) -> None:
    """Undo what driving has done to the groups that no amplifier drives, and advance them by themselves."""
    driving, faults = faulty.driving, faulty.faults
    flow, kept = driving.flow, faults.kept
    for j in range(current.shape[0]):
        contact = _contact(faults, j)
        if contact != DRIVEN:
            current[j], flow.copper_J[j], flow.work_J[j] = kept[0, j], kept[1, j], kept[2, j]
            flow.voltage_limited_s[j], flow.current_limited_s[j] = kept[3, j], kept[4, j]
            step_s = driving.amplifier.step_s
            undriven(contact, driving.coil, j, step_s, driving.emf[j], current, mean, flow)


@part_of_its_caller
def _contact(faults: DriveFaults, group: int) -> int:
    """How a group is connected: a brake shorts all that are not open."""
    contact = faults.contact[group]
    return SHORTED if contact != OPEN and faults.halt[0] == BRAKED else contact


@part_of_its_caller
def end(faulty: FaultyDriving) -> bool:
    """End a control period, as `chain.end` does."""
    return chain.end(faulty.driving)


@part_of_its_caller
def tell(faulty: FaultyDriving, row: Array) -> None:
    """Write the telemetry of the control period, as `chain.tell` does, with the supply as it was."""
    chain.tell(faulty.driving, row)
    row[0] = faulty.faults.supply_V[0] * faulty.driving.drawn_As[0] / faulty.driving.coil.period_s


def state_of(faulty: FaultyDriving) -> Array:
    """All that the stages go on from; what is wrong follows from the plan."""
    return np.concatenate([chain.state_of(faulty.driving), faulty.faults.last_A])


def restore(faulty: FaultyDriving, state: Array) -> None:
    """Go on from a state of stages of the same size."""
    groups = len(faulty.faults.last_A)
    chain.restore(faulty.driving, state[:-groups])
    faulty.faults.last_A[:] = state[-groups:]
