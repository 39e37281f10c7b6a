"""Voltages that magnetically coupled coil groups induce in each other.

With the mutual inductances M the groups obey ``L di/dt = v - R i - e - M di/dt``. The mean of the induced
voltage over a time T is ``M (i(T) - i(0)) / T``, for any course of the currents. It acts like a back-EMF that
is held over this time: an amplifier rejects it as long as its voltage is within the swing, and the solution
of `amplifier` applies. Each group satisfies its equation with this mean, so that the change of its flux
linkage is exact. The induced voltage is not constant: the method is of second order.

Currents change most at the start of a step, within a few time constants of the current loops. A physics step
has two parts, of which the first takes `FIRST_PART` of these time constants, and at most half of the step.

The changes of the currents depend on the induced voltages, and the reverse. They are found by iteration. The
current of a group that follows its target does not depend on the induced voltage, so that only groups at a
voltage limit, open and shorted groups need more than one sweep. A sweep reduces the error to the ratio of
mutual to own inductance or less.

The exact solution for the induced voltages at each time is a linear system of all groups in each phase
between two events at a voltage limit. With power series of time, a step had up to 43 phases, and the loop
took 27 to 65 times as long: under `afsm_eso` on the prototype some group is at a limit in nine of ten ticks.
"""

from __future__ import annotations

import numpy as np

from spheretwin.electronics.amplifier import Amplifier, Step, fill_step
from spheretwin.electronics.coil import GroupCoils
from spheretwin.electronics.drive_section import ResolvedDrive
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.errors import InputError, distinct_texts
from spheretwin.models.base.record import Record, Rows, field, put

# In time constants of the current loop. Between 1 and 2.5 the error of the mean currents hardly changes: a
# fifth of their change by the coupling at the step of the plant, with one part three fifths.
FIRST_PART = 1.6

# The error of the currents is below a tenth of this: a few ten-thousandths of a code of the converter.
TOLERANCE_A = 1e-6

# A sweep gains a digit; the bound is reached only by groups that are coupled almost completely.
MOST_SWEEPS = 30


class Coupling(Record):
    """Coupling of all groups."""

    on: bool = field("whether the groups are coupled")
    parts: tuple[Step, ...] = field("the two parts of a physics step", shape=2)
    mutual_H: Array = field("mutual inductances", "H", ("groups", "groups"))
    own_emf: Array = field("EMF by the motion of the rotor", "V", "groups")
    change_A: Array = field(
        "changes of the currents in a part that the induced voltages belong to", "A", "groups"
    )
    charge_As: Array = field("of the parts of this step", "As", "groups")


def fill_coupling(rows: Rows, section: ResolvedDrive, mutual_H: Array, step_s: float) -> None:
    """Fill the coupling of the groups of drives with mutual inductances (n, n), H; 0 without coupling."""
    check_coupling(section, mutual_H)
    first_s = np.minimum(FIRST_PART / section.bandwidth_rad_s, step_s / 2)
    fill_step(rows["parts"][:, 0], section, first_s)
    fill_step(rows["parts"][:, 1], section, step_s - first_s)
    share = np.asarray(section.coil_coupling)[..., None]
    put(rows, on=True, mutual_H=share * mutual_H)
    rows[np.broadcast_to(share == 0, (len(rows), 1, 1))[:, 0, 0]] = np.zeros(1, rows.dtype)


def check_coupling(section: ResolvedDrive, mutual_H: Array) -> None:
    """Check that the inductances of the groups exceed the mutual inductances.

    Raises
    ------
    InputError
        They do not, so that some currents would have a negative magnetic energy.
    """
    inductance_H = np.multiply(section.inductance_H, np.ones(len(mutual_H)))
    shares = mutual_H / np.sqrt(inductance_H[..., None] * inductance_H[..., None, :])
    largest = section.coil_coupling * np.abs(np.linalg.eigvalsh(shares)).max(axis=-1, keepdims=True)
    least_H = inductance_H.min(axis=-1, keepdims=True)
    if (wrong := ~(largest < 1)).any():
        columns = np.broadcast_arrays(largest, least_H, section.coil_coupling)
        share, least, coupling = (values[wrong].item(0) for values in columns)
        smallest, received = distinct_texts(share * least, least)
        raise InputError(
            f"drive: expected inductance_H above {smallest} H for a coil_coupling of"
            f" {coupling:g} of the model's coils, received {received} H"
        )


@inlined
def predict_changes(
    coupling: Coupling,
    amplifier: Amplifier,
    step: Step,
    coil: GroupCoils,
    setpoint: Array,
    current: Array,
) -> None:
    """Predict the changes of the currents: those of uncoupled groups that are at a limit never or always."""
    limit = amplifier.current_limit_A
    for j in range(current.shape[0]):
        per_volt = step.step_s / coil.inductance_H[j]
        target = min(max(setpoint[j] + amplifier.offset_A[j], -limit), limit)
        opposed = coil.resistance_ohm[j] * current[j] + coupling.own_emf[j]
        change = step.following[0] * (target - current[j])
        change = min(change, per_volt * max(amplifier.highest_V - opposed, 0.0))
        coupling.change_A[j] = max(change, per_volt * min(amplifier.lowest_V - opposed, 0.0))


@inlined
def induce_voltages(coupling: Coupling, duration_s: float, emf: Array) -> None:
    """Compute the EMF by the motion of the rotor and by the changes of the currents in a time."""
    for j in range(emf.shape[0]):
        emf[j] = coupling.own_emf[j]
    for k in range(emf.shape[0]):
        slope = coupling.change_A[k] / duration_s
        for j in range(emf.shape[0]):
            emf[j] += coupling.mutual_H[k, j] * slope


@inlined
def update_changes(coupling: Coupling, start: Array, current: Array) -> bool:
    """Update the changes of the currents since the start of the part; return True if they stay the same."""
    largest = 0.0
    for j in range(current.shape[0]):
        change = current[j] - start[j]
        largest = max(largest, abs(change - coupling.change_A[j]))
        coupling.change_A[j] = change
    return not largest > TOLERANCE_A
