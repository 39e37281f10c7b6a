"""MuJoCo rotor engine, stepped from compiled code."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.models.base.compiled import COMPILES, compiled
from spheretwin.models.base.mujoco_library import addresses, step_address
from spheretwin.models.base.numba_internals.addresses import external_function
from spheretwin.models.mjcf import Mjcf, idle_stages
from spheretwin.plant.mass_properties import MassErrors, true_model
from spheretwin.plant.rotor import EngineKind

INTEGRATORS = {
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
}


def integrator_name(number: int) -> str:
    """Return the MJCF name of an integrator of MuJoCo."""
    names = {int(integrator): name for name, integrator in INTEGRATORS.items()}
    return names.get(number, mujoco.mjtIntegrator(number).name.removeprefix("mjINT_").lower())


class MujocoData(NamedTuple):
    """Data of MuJoCo for compiled code: two addresses, and views of MuJoCo's arrays."""

    model_address: int
    data_address: int
    q: NDArray[np.float64]  # (3,) rad
    qdot: NDArray[np.float64]  # (3,) rad/s
    torque_q: NDArray[np.float64]  # (3,) N·m on the hinges
    warnings: NDArray[np.int32]  # count of warnings of the engine, of each kind


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

    def start(self, q: NDArray[np.float64], qdot: NDArray[np.float64]) -> MujocoData:
        """Set pose and rates at time 0; return the data that compiled code steps.

        Parameters
        ----------
        q : (3,) array, rad
            Hinge angles.
        qdot : (3,) array, rad/s
            Hinge rates.
        """
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = q, qdot
        return MujocoData(
            *addresses(self.model, self.data),
            self.data.qpos,
            self.data.qvel,
            self.data.qfrc_applied,
            self.data.warning.number,
        )

    def state(self) -> NDArray[np.float64]:
        """Return the complete state, including the warm start of the solver."""
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def restore(self, state: NDArray[np.float64]) -> None:
        """Restore a state of a rotor with the same model; the data of `start` stays valid."""
        mujoco.mj_setState(self.model, self.data, state, _STATE)


_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


_mj_step: Any
if COMPILES:
    _mj_step = external_function("mj_step", step_address(), types.void(types.intp, types.intp))
else:
    _mj_step = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(step_address())


@compiled
def step(data: MujocoData) -> None:
    """Advance MuJoCo by one physics step, from compiled code or from Python."""
    _mj_step(data.model_address, data.data_address)


MUJOCO = EngineKind(
    "mujoco",
    lambda settings: MujocoRotor(
        settings.model,
        settings.step_s,
        settings.integrator,
        settings.modelling_error,
        settings.payload_kg,
        settings.gravity_m_s2,
        settings.mass,
    ),
    MujocoData,
    step,
)
