"""From commands to currents: the stages of all groups, one after the other, over a control period."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.kinematics import angular_velocity
from spheretwin.twin.electronics.driving.amplifier import Amplifier, Flow, amplifier, clear, drive_coils, flow
from spheretwin.twin.electronics.driving.coil import Coil, back_emf, coil, overheated, settle_resistance, warm
from spheretwin.twin.electronics.driving.dac import Dac, convert, dac
from spheretwin.twin.electronics.driving.delay import Delay, delay, due, latch
from spheretwin.twin.electronics.driving.lag import Drive, drive
from spheretwin.twin.electronics.driving.lag import advance as follow
from spheretwin.twin.electronics.driving.sections import ResolvedDrive

Array = NDArray[np.float64]


class Driving(NamedTuple):
    """All stages, for compiled code."""

    converts: bool  # whether what is asked of the amplifiers is other than the command
    supplied: bool  # whether the amplifiers have a supply, and the coils a voltage
    supply_V: float
    lag: Drive
    delay: Delay
    dac: Dac
    amplifier: Amplifier
    coil: Coil
    flow: Flow
    asked: Array  # (n,) A of the amplifiers
    emf: Array  # (n,) V
    rate_S: Array  # (3,) rad/s of the rotor, stator frame
    drawn_As: Array  # (1,) from the supply in this control period


def driving(section: ResolvedDrive, step_s: float, substeps: int, groups: int, seed: int) -> Driving:
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

    Raises
    ------
    ValueError
        The delay is no whole number of physics steps.
    """
    return Driving(
        converts=section.converts,
        supplied=section.supply_V is not None,
        supply_V=0.0 if section.supply_V is None else section.supply_V,
        lag=drive(section.lag_s, step_s, section.current_limit_A),
        delay=delay(section, step_s, substeps, groups),
        dac=dac(section, section.transconductance_A_V, groups, seed),
        amplifier=amplifier(section, section.current_limit_A, step_s, groups, seed),
        coil=coil(section, section.resistance_ohm, section.inductance_H, substeps * step_s, groups),
        flow=flow(groups),
        asked=np.zeros(groups),
        emf=np.zeros(groups),
        rate_S=np.zeros(3),
        drawn_As=np.zeros(1),
    )


@part_of_its_caller
def begin(driving: Driving, command: Array) -> None:
    """Take the commands of a control period, and begin its sums."""
    if driving.converts:
        convert(driving.dac, command, driving.asked)
        latch(driving.delay, driving.asked)
    if driving.supplied:
        clear(driving.flow)
        driving.drawn_As[0] = 0.0


@part_of_its_caller
def advance(
    driving: Driving,
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
    driving : Driving
    command : (n,) array, A
        Of this control period.
    substep : int
        Physics step of the period, from 0.
    q, qdot : (3,) arrays, rad and rad/s
        At the start of the step.
    G : (3, n) array, N·m/A
        True torque matrix there.
    gain : (n,) array
        Of each group, over that matrix.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Result: over the step.
    """
    asked = driving.asked if driving.converts else command
    if driving.converts:
        due(driving.delay, substep, asked)
    if driving.supplied:
        angular_velocity(q, qdot, driving.rate_S)
        back_emf(G, gain, driving.rate_S, driving.emf)
        drive_coils(driving.amplifier, driving.coil, asked, driving.emf, current, driving.flow)
        for j in range(mean.shape[0]):
            mean[j] = driving.flow.mean_current_A[j]
            driving.drawn_As[0] += abs(mean[j]) * driving.amplifier.step_s
    else:
        follow(driving.lag, asked, current, mean)


@part_of_its_caller
def end(driving: Driving) -> bool:
    """End a control period: the coils have warmed by what they lost; whether none is too hot."""
    if driving.supplied:
        warm(driving.coil, driving.flow.copper_J)
        return not overheated(driving.coil)
    return True


@part_of_its_caller
def tell(driving: Driving, row: Array) -> None:
    """Write power, losses, temperatures and limits of the control period into the beginning of `row`."""
    flow, period_s, groups = driving.flow, driving.coil.period_s, driving.emf.shape[0]
    row[0] = driving.supply_V * driving.drawn_As[0] / period_s
    for j in range(groups):
        row[1 + j] = flow.work_J[j] / period_s
        row[1 + groups + j] = flow.copper_J[j] / period_s
        row[1 + 2 * groups + j] = driving.coil.temperature_degC[j]
        row[1 + 3 * groups + j] = flow.voltage_limited_s[j] / period_s
        row[1 + 4 * groups + j] = flow.current_limited_s[j] / period_s


def state_of(driving: Driving) -> Array:
    """All that the stages go on from."""
    late = driving.delay
    return np.concatenate([late.ring.ravel(), late.newest, driving.coil.temperature_degC])


def restore(driving: Driving, state: Array) -> None:
    """Go on from a state of stages of the same size."""
    late, first = driving.delay, driving.delay.ring.size
    late.ring[:] = state[:first].reshape(late.ring.shape)
    late.newest[:] = state[first : first + 1]
    driving.coil.temperature_degC[:] = state[first + 1 :]
    settle_resistance(driving.coil)


def carried_on(before: Driving, after: Driving) -> None:
    """Go on as before with other figures; where more commands are kept now, the oldest repeats."""
    was, now = before.delay, after.delay
    rows = len(was.ring)
    for ago in range(len(now.ring)):
        now.ring[-1 - ago] = was.ring[(was.newest[0] - min(ago, rows - 1)) % rows]
    now.newest[0] = len(now.ring) - 1
    after.coil.temperature_degC[:] = before.coil.temperature_degC
    settle_resistance(after.coil)
