"""MuJoCo rotor engine, stepped from compiled code."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numba import types
from numpy.typing import ArrayLike

from spheretwin.models.base.addresses import external_function
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import COMPILES, allocation_free
from spheretwin.models.base.memory import read_integer, read_number, write_number
from spheretwin.models.base.mujoco_library import addresses, step_address
from spheretwin.models.base.record import put
from spheretwin.models.mjcf import idle_stages
from spheretwin.plant.mass_properties import row_of
from spheretwin.plant.rotor import EngineKind, Number, RotorData, RotorSettings

INTEGRATORS = {
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
}


def integrator_name(number: int) -> str:
    """Return the MJCF name of an integrator of MuJoCo."""
    names = {int(integrator): name for name, integrator in INTEGRATORS.items()}
    return names.get(number, mujoco.mjtIntegrator(number).name.removeprefix("mjINT_").lower())


class MujocoRotor:
    """Rotor of a run, or of n rows, in MuJoCo.

    Parameters
    ----------
    models : sequence of MjModel, one for each row
        Of `true_model`; step, integrator and flags are changed.
    step_s : float or (n, 1) array, s
        Physics step.
    integrator : str
        One of `INTEGRATORS`.

    Attributes
    ----------
    machines : list of (MjModel, MjData)
        Of each row.
    rows : array of RotorData
    """

    def __init__(self, models: Sequence[mujoco.MjModel], step_s: Number, integrator: str) -> None:
        self.machines = [_machine(model, row_of(step_s, row), integrator) for row, model in enumerate(models)]
        self.rows = RotorData.zeros(len(models))

    @property
    def model(self) -> mujoco.MjModel:
        """Model of the first row."""
        return self.machines[0][0]

    @property
    def data(self) -> mujoco.MjData:
        """Data of the first row."""
        return self.machines[0][1]

    def start(self, q: ArrayLike, qdot: ArrayLike) -> Any:
        """Set pose and rates at time 0; return the first record, which compiled code steps.

        Parameters
        ----------
        q : (3,) or (n, 3) array, rad
            Hinge angles.
        qdot : (3,) or (n, 3) array, rad/s
            Hinge rates.
        """
        put(self.rows, q=q, qdot=qdot, torque_q=0.0, warnings=0)
        for (model, data), row in zip(self.machines, self.rows, strict=True):
            mujoco.mj_resetData(model, data)
            arrays = data.qpos, data.qvel, data.qfrc_applied, data.warning.lastinfo
            row["addresses"] = *addresses(model, data), *(array.ctypes.data for array in arrays)
        self._write_poses()
        return self.rows[0]

    def state(self) -> list[Array]:
        """Return the complete state of each row, including the warm start of the solver."""
        self._write_poses()
        states = [np.empty(mujoco.mj_stateSize(model, _STATE)) for model, _ in self.machines]
        for (model, data), state in zip(self.machines, states, strict=True):
            mujoco.mj_getState(model, data, state, _STATE)
        return states

    def restore(self, states: Sequence[Array]) -> None:
        """Restore the state of each row of a rotor with the same models."""
        for (model, data), row, state in zip(self.machines, self.rows, states, strict=True):
            mujoco.mj_setState(model, data, state, _STATE)
            row["q"], row["qdot"], row["torque_q"] = data.qpos, data.qvel, data.qfrc_applied

    def _write_poses(self) -> None:
        """Write pose and rates of the records to MuJoCo, as a step does."""
        for (_, data), row in zip(self.machines, self.rows, strict=True):
            data.qpos[:], data.qvel[:] = row["q"], row["qdot"]


def _machine(model: mujoco.MjModel, step_s: float, integrator: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model.opt.timestep, model.opt.integrator = step_s, INTEGRATORS[integrator]
    # A diverged state must stay visible: the automatic reset would replace it by zeros.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET) | idle_stages(model)
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    return model, data


_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)

MODEL, DATA, POSE, RATES, TORQUE, COUNTS = range(6)
"""Places in `RotorData.addresses`."""

WARNINGS = int(mujoco.mjtWarning.mjNWARNING)
"""Kinds of warnings; of each MuJoCo has two integers of four bytes, the second of which is a count."""


_mj_step: Any
if COMPILES:
    _mj_step = external_function("mj_step", step_address(), types.void(types.intp, types.intp))
else:
    _mj_step = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(step_address())


@allocation_free
def step(rotor: RotorData) -> None:
    """Advance MuJoCo by one physics step from the pose, rates and torque of a rotor."""
    addresses = rotor.addresses
    for i in range(3):
        write_number(addresses[POSE], i, rotor.q[i])
        write_number(addresses[RATES], i, rotor.qdot[i])
        write_number(addresses[TORQUE], i, rotor.torque_q[i])
    _mj_step(int(addresses[MODEL]), int(addresses[DATA]))
    for i in range(3):
        rotor.q[i], rotor.qdot[i] = read_number(addresses[POSE], i), read_number(addresses[RATES], i)
    rotor.warnings = 0
    for kind in range(WARNINGS):
        rotor.warnings += read_integer(addresses[COUNTS], 2 * kind + 1)


def _set_up(settings: RotorSettings) -> MujocoRotor:
    models = [settings.true_model(row) for row in range(settings.rows)]
    rotor = MujocoRotor(models, settings.step_s, settings.integrator)
    settings.fill_joint(rotor.rows["joint"])
    return rotor


MUJOCO = EngineKind("mujoco", _set_up, step)
