"""Coils of one `mjData` for compiled code: derivatives of currents, torque on the hinges, sensors."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.record import Rows
from spheretwin.models.kinematics import generalised_torque
from spheretwin.models.magnetics import (
    CachedMatrix,
    rotor_torque,
    torque_model,
    update_cached_matrix,
)
from spheretwin.mujoco_plugin.configuration import CURRENT, TORQUE, Parts

Array = NDArray[np.float64]
Addresses = NDArray[np.int64]

# Values of `task`.
ACT_DOT, FORCE, SENSORS = 0, 1, 2


class Coils(NamedTuple):
    """Coils of one instance in one `mjData`."""

    magnetics: Any  # of `torque_model`
    matrix: Rows  # of one `CachedMatrix`
    gain: Array  # (n,) torque per ampere over that of the matrix
    has_voltages: int  # 1 if the controls are voltages: the activations are currents behind R and L
    resistance_ohm: Array  # (n,)
    inductance_H: Array  # (n,)
    qpos_at: Addresses  # (3,)
    qvel_at: Addresses  # (3,)
    ctrl_at: Addresses  # (n,)
    ctrl_range: Array  # (n, 2)
    act_at: Addresses  # (n,); -1 if the controls are currents that act at once
    force_at: Addresses  # (n,)
    sensors: Addresses  # (k, 2) quantity, address
    # Views of the arrays of mjData.
    qpos: Array
    qvel: Array
    ctrl: Array
    act: Array
    act_dot: Array
    force: Array  # A; the engine multiplies it by the moments
    moment: Array  # N·m/A
    moment_row: NDArray[np.int32]  # address of the row of each force
    sensordata: Array
    # Working space.
    q: Array  # (3,) rad
    torque_S: Array  # (3,) N·m
    torque_q: Array  # (3,) N·m
    column_q: Array  # (3, n) N·m/A, torque on the hinges per ampere
    effective: Array  # (n,) A, current times gain


def coils_of(parts: Parts, data: dict[str, NDArray[Any]]) -> Coils:
    """Return the coils of an instance, with views of the arrays of `mjData` by their name here."""
    magnetics, n = torque_model(parts.actuator), len(parts.actuator.groups)
    matrix = CachedMatrix.zeros(groups=n, lines=len(magnetics.line_weights))
    matrix["q"] = np.nan
    return Coils(
        magnetics=magnetics,
        matrix=matrix,
        gain=parts.gain,
        has_voltages=int(parts.attributes.input == "voltage"),
        resistance_ohm=parts.resistance_ohm,
        inductance_H=parts.inductance_H,
        qpos_at=parts.qpos,
        qvel_at=parts.qvel,
        ctrl_at=parts.ctrl,
        ctrl_range=parts.ctrl_range,
        act_at=parts.act,
        force_at=parts.force,
        sensors=parts.sensors,
        **data,
        q=np.empty(3),
        torque_S=np.empty(3),
        torque_q=np.empty(3),
        column_q=np.empty((3, n)),
        effective=np.empty(n),
    )


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
            resistive_V = coils.resistance_ohm[j] * coils.act[coils.act_at[j]]
            voltage_V = _control(coils, j) - resistive_V - _emf(coils, j)
            coils.act_dot[coils.act_at[j]] = voltage_V / coils.inductance_H[j]
    elif task == FORCE:
        _apply(coils)
    else:
        _fill_sensors(coils)


@allocation_free
def _update_columns(coils: Coils) -> None:
    """Compute the torque on the hinges per ampere of each group, ``E^T G_t(q)`` times gain."""
    q, G, axis, of_axis = coils.q, coils.matrix[0].G, coils.torque_S, coils.torque_q
    for i in range(3):
        q[i] = coils.qpos[coils.qpos_at[i]]
    update_cached_matrix(q, coils.magnetics, coils.matrix[0])
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
    return min(max(coils.ctrl[coils.ctrl_at[group]], low), high)


@allocation_free
def _emf(coils: Coils, group: int) -> float:
    """Return the back-EMF of a group, V; by virtual power its column times the rates."""
    total = 0.0
    for i in range(3):
        total += coils.column_q[i, group] * coils.qvel[coils.qvel_at[i]]
    return total


@allocation_free
def _apply(coils: Coils) -> None:
    """Write the current of each group as force of its actuator, and its column as the moment of the force.

    The transmission of each actuator is a fixed tendon over the three hinges: its row of the moments has
    three entries, in the order of the hinges.
    """
    for j in range(coils.gain.shape[0]):
        is_state, force = coils.act_at[j] >= 0, coils.force_at[j]
        coils.force[force] = coils.act[coils.act_at[j]] if is_state else _control(coils, j)
        for i in range(3):
            coils.moment[coils.moment_row[force] + i] = coils.column_q[i, j]


@allocation_free
def _fill_sensors(coils: Coils) -> None:
    """Write currents (A), back-EMFs (V) and coil torque (N·m, stator frame) into the sensors."""
    for j in range(coils.gain.shape[0]):
        coils.effective[j] = coils.gain[j] * coils.force[coils.force_at[j]]
    rotor_torque(coils.matrix[0].G, coils.effective, coils.torque_S)
    for k in range(coils.sensors.shape[0]):
        quantity, first = coils.sensors[k, 0], coils.sensors[k, 1]
        if quantity == TORQUE:
            for i in range(3):
                coils.sensordata[first + i] = coils.torque_S[i]
        else:
            for j in range(coils.gain.shape[0]):
                current = coils.force[coils.force_at[j]]
                coils.sensordata[first + j] = current if quantity == CURRENT else _emf(coils, j)
