"""Coils of one `mjData` for compiled code: derivatives of currents, torque on the hinges, sensors."""

from __future__ import annotations

import numpy as np

from spheretwin.models.base.arrays import Array, Integers
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.memory import read_integer, read_number, write_number
from spheretwin.models.base.record import Record, Rows, field
from spheretwin.models.kinematics import generalised_torque
from spheretwin.models.magnetics import (
    Arrangement,
    CachedMatrix,
    Tables,
    rotor_torque,
    torque_model,
    update_cached_matrix,
)
from spheretwin.mujoco_plugin.configuration import CURRENT, TORQUE, Parts

# Values of `task`.
ACT_DOT, FORCE, SENSORS = 0, 1, 2


class Coils(Record):
    """Coils of one instance in one `mjData`."""

    arrangement: Arrangement = field("poles and coil groups")
    curve_table: Array = field("`Tables.curve`", "", ("pieces", 4))
    field_table: Array = field("`Tables.field`", "", ("latitudes", "meridians", 3))
    matrix: CachedMatrix = field("torque matrix of the present pose")
    gain: Array = field("torque per ampere over that of the matrix", "", "groups")
    has_voltages: bool = field("whether controls are voltages: activations are currents behind R and L")
    resistance_ohm: Array = field("of each group", "ohm", "groups")
    inductance_H: Array = field("of each group", "H", "groups")
    qpos_at: Integers = field("places of the hinges", "", 3)
    qvel_at: Integers = field("places of the hinges", "", 3)
    ctrl_at: Integers = field("place of each control", "", "groups")
    ctrl_range: Array = field("of each control", "", ("groups", 2))
    act_at: Integers = field("place of each activation; -1 if controls act at once", "", "groups")
    force_at: Integers = field("place of each actuator", "", "groups")
    sensors: Integers = field("quantity and place of each sensor", "", ("sensors", 2))
    qpos: int = field("address in mjData")
    qvel: int = field("address in mjData")
    ctrl: int = field("address in mjData")
    act: int = field("address in mjData")
    act_dot: int = field("address in mjData")
    force: int = field("address in mjData; A, the engine multiplies it by the moments")
    moment: int = field("address in mjData; N·m/A")
    moment_row: int = field("address in mjData of the place of the row of each force")
    sensordata: int = field("address in mjData")
    q: Array = field("working space", "rad", 3)
    torque_S: Array = field("working space", "N·m", 3)
    torque_q: Array = field("working space", "N·m", 3)
    column_q: Array = field("torque on the hinges per ampere", "N·m/A", (3, "groups"))
    effective: Array = field("current times gain", "A", "groups")


def coils_of(parts: Parts, addresses: dict[str, int]) -> Rows:
    """Return the coils of an instance, an array of one record, with addresses of the arrays of `mjData`."""
    magnetics, tables = (model := torque_model(parts.actuator)).arrangement, model.tables
    latitudes, meridians = tables.field.shape[:2]
    sensors = len(parts.sensors)
    rows = Coils.zeros(
        pieces=len(tables.curve), latitudes=latitudes, meridians=meridians, sensors=sensors, **model.sizes
    )
    rows["arrangement"], rows["curve_table"], rows["field_table"] = magnetics, *tables
    rows["matrix"]["q"], rows["has_voltages"] = np.nan, parts.attributes.input == "voltage"
    for name in ("gain", "resistance_ohm", "inductance_H", "ctrl_range", "sensors"):
        rows[name] = getattr(parts, name)
    for name, address in addresses.items():
        rows[name] = address
    for name in _PLACES:
        rows[f"{name}_at"] = getattr(parts, name)
    return rows


_PLACES = "qpos", "qvel", "ctrl", "act", "force"


@allocation_free
def respond(coils: Coils, task: int) -> None:
    """Write what the engine has asked for into the arrays of `mjData`.

    Parameters
    ----------
    coils : Coils
    task : int
        `ACT_DOT`, `FORCE` or `SENSORS`.
    """
    if task == ACT_DOT and not coils.has_voltages:
        return
    _update_columns(coils)
    if task == ACT_DOT:
        for j in range(coils.gain.shape[0]):
            resistive_V = coils.resistance_ohm[j] * read_number(coils.act, coils.act_at[j])
            voltage_V = _control(coils, j) - resistive_V - _emf(coils, j)
            write_number(coils.act_dot, coils.act_at[j], voltage_V / coils.inductance_H[j])
    elif task == FORCE:
        _apply(coils)
    else:
        _fill_sensors(coils)


@allocation_free
def _update_columns(coils: Coils) -> None:
    """Compute the torque on the hinges per ampere of each group, ``E^T G_t(q)`` times gain."""
    q, G, axis, of_axis = coils.q[:], coils.matrix.G, coils.torque_S[:], coils.torque_q[:]
    for i in range(3):
        q[i] = read_number(coils.qpos, coils.qpos_at[i])
    tables = Tables(coils.curve_table[:], coils.field_table[:])
    update_cached_matrix(q, coils.arrangement, tables, coils.matrix)
    coils.column_q[:] = 0.0
    for k in range(3):  # the columns of E^T: the torque on the hinges of 1 N·m about each axis of the stator
        for i in range(3):
            axis[i] = 1.0 if i == k else 0.0
        generalised_torque(q, axis, of_axis)
        for i in range(3):
            for j in range(coils.gain.shape[0]):
                coils.column_q[i, j] += of_axis[i] * G[k, j] * coils.gain[j]


@allocation_free
def _control(coils: Coils, group: int) -> float:
    low, high = coils.ctrl_range[group, 0], coils.ctrl_range[group, 1]
    return min(max(read_number(coils.ctrl, coils.ctrl_at[group]), low), high)


@allocation_free
def _emf(coils: Coils, group: int) -> float:
    """Return the back-EMF of a group, V; by virtual power its column times the rates."""
    total = 0.0
    for i in range(3):
        total += coils.column_q[i, group] * read_number(coils.qvel, coils.qvel_at[i])
    return total


@allocation_free
def _apply(coils: Coils) -> None:
    """Write the current of each group as force of its actuator, and its column as the moment of the force.

    The transmission of each actuator is a fixed tendon over the three hinges: its row of the moments has
    three entries, in the order of the hinges.
    """
    for j in range(coils.gain.shape[0]):
        place, force = coils.act_at[j], coils.force_at[j]
        current = read_number(coils.act, place) if place >= 0 else _control(coils, j)
        write_number(coils.force, force, current)
        row = read_integer(coils.moment_row, force)
        for i in range(3):
            write_number(coils.moment, row + i, coils.column_q[i, j])


@allocation_free
def _fill_sensors(coils: Coils) -> None:
    """Write currents (A), back-EMFs (V) and coil torque (N·m, stator frame) into the sensors."""
    for j in range(coils.gain.shape[0]):
        coils.effective[j] = coils.gain[j] * read_number(coils.force, coils.force_at[j])
    rotor_torque(coils.matrix.G[:], coils.effective[:], coils.torque_S[:])
    for k in range(coils.sensors.shape[0]):
        quantity, first = coils.sensors[k, 0], coils.sensors[k, 1]
        if quantity == TORQUE:
            for i in range(3):
                write_number(coils.sensordata, first + i, coils.torque_S[i])
        else:
            for j in range(coils.gain.shape[0]):
                current = read_number(coils.force, coils.force_at[j])
                write_number(coils.sensordata, first + j, current if quantity == CURRENT else _emf(coils, j))
