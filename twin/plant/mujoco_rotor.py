"""MuJoCo rotor engine, stepped from compiled code."""

from __future__ import annotations

import ctypes
from typing import Any

import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.models.base.addresses import external_function
from spheretwin.models.base.compiled import COMPILES, allocation_free
from spheretwin.models.base.memory import read_integer, read_number, write_number
from spheretwin.models.base.mujoco_library import addresses, step_address
from spheretwin.models.mjcf import Mjcf, idle_stages
from spheretwin.plant.mass_properties import MassErrors, true_model
from spheretwin.plant.rotor import EngineKind, RotorData, RotorSettings

Array = NDArray[np.float64]

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
    """Rotor of one run in MuJoCo.

    Parameters
    ----------
    mjcf : Mjcf
        Model file; not changed.
    step_s : float, s
        Physics step.
    integrator : str
        One of `INTEGRATORS`.
    modelling_error : float
        m: the rotor's inertia is (1 + m) times that of the MJCF (11), (54).
    payload_kg : float, kg
        Point mass at the payload mount; 0 for none.
    gravity_m_s2 : float, m/s²
        Gravity along -z; default: that of the model.
    mass : MassErrors
        Differences from the model file; default: none.
    """

    def __init__(
        self,
        mjcf: Mjcf,
        step_s: float,
        integrator: str,
        modelling_error: float,
        payload_kg: float,
        gravity_m_s2: float | None = None,
        mass: MassErrors | None = None,
    ) -> None:
        self.model = true_model(mjcf, modelling_error, payload_kg, gravity_m_s2, mass)
        self.model.opt.timestep = step_s
        self.model.opt.integrator = INTEGRATORS[integrator]
        # A diverged state must stay visible: the automatic reset would replace it by zeros.
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET) | idle_stages(self.model)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_setConst(self.model, self.data)
        self.rows = RotorData.zeros()

    def start(self, q: Array, qdot: Array) -> Any:
        """Set pose and rates at time 0; return the record that compiled code steps.

        Parameters
        ----------
        q : (3,) array, rad
            Hinge angles.
        qdot : (3,) array, rad/s
            Hinge rates.
        """
        mujoco.mj_resetData(self.model, self.data)
        data = self.data
        arrays = data.qpos, data.qvel, data.qfrc_applied, data.warning.lastinfo
        places = [array.ctypes.data for array in arrays]
        self.rows["addresses"] = *addresses(self.model, data), *places
        self.rows["q"], self.rows["qdot"], self.rows["torque_q"], self.rows["warnings"] = q, qdot, 0.0, 0
        self._write_pose()
        return self.rows[0]

    def state(self) -> Array:
        """Return the complete state, including the warm start of the solver."""
        self._write_pose()
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def restore(self, state: Array) -> None:
        """Restore a state of a rotor with the same model."""
        mujoco.mj_setState(self.model, self.data, state, _STATE)
        self.rows["q"], self.rows["qdot"] = self.data.qpos, self.data.qvel
        self.rows["torque_q"] = self.data.qfrc_applied

    def _write_pose(self) -> None:
        """Write pose and rates of the record to MuJoCo, as a step does."""
        self.data.qpos[:], self.data.qvel[:] = self.rows["q"][0], self.rows["qdot"][0]


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
    rotor = MujocoRotor(
        settings.model,
        settings.step_s,
        settings.integrator,
        settings.modelling_error,
        settings.payload_kg,
        settings.gravity_m_s2,
        settings.mass,
    )
    settings.fill_joint(rotor.rows["joint"])
    return rotor


MUJOCO = EngineKind("mujoco", _set_up, step)
