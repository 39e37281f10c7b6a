"""MuJoCo as the plant: the rotor on its joint, stepped from compiled code."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import NamedTuple

import llvmlite.binding
import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.models.actuator import read_spec
from spheretwin.models.compiled import compiled
from spheretwin.models.mujoco_library import library

INTEGRATORS = {
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
}


class Engine(NamedTuple):
    """The engine as compiled code sees it: two addresses, and views of MuJoCo's own arrays."""

    model_address: int
    data_address: int
    q: NDArray[np.float64]  # (3,) rad
    qdot: NDArray[np.float64]  # (3,) rad/s
    torque_S: NDArray[np.float64]  # (3,) N·m on the rotor, stator frame
    torque_q: NDArray[np.float64]  # (3,) N·m on the hinges


class Rotor:
    """The rotor in MuJoCo, set up for one run.

    Parameters
    ----------
    mjcf : Path
        Model file.
    step_s : float, s
        Physics step.
    integrator : str
        One of `INTEGRATORS`.
    modelling_error : float
        m: the rotor's inertia is (1 + m) times that of the MJCF (11), (54).
    payload_kg : float, kg
        Point mass at the payload mount; 0 for none.
    """

    def __init__(
        self, mjcf: Path, step_s: float, integrator: str, modelling_error: float, payload_kg: float
    ) -> None:
        spec = read_spec(mjcf)
        for site in spec.sites:  # only read and drawn; each costs time in every stage of a step
            spec.delete(site)
        self.model = spec.compile()
        self.model.opt.timestep = step_s
        self.model.opt.integrator = INTEGRATORS[integrator]
        self.model.opt.disableflags |= _idle_stages(self.model)
        rotor = self.model.body("rotor").id
        self.model.body_inertia[rotor] *= 1 + modelling_error
        payload = self.model.body("payload").id
        self.model.body_mass[payload] = payload_kg
        self.model.body_ipos[payload] = 0.0  # the compiler leaves it elsewhere for a body without mass
        self.data = mujoco.MjData(self.model)
        mujoco.mj_setConst(self.model, self.data)
        self._rotor = rotor

    def start(self, q: NDArray[np.float64], qdot: NDArray[np.float64]) -> Engine:
        """Set pose (rad) and rates (rad/s) at time 0; return what compiled code steps."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = q, qdot
        return Engine(
            self.model._address,
            self.data._address,
            self.data.qpos,
            self.data.qvel,
            self.data.xfrc_applied[self._rotor, 3:],
            self.data.qfrc_applied,
        )

    def warnings(self) -> list[str]:
        """Names of the warnings that MuJoCo has counted since the start."""
        kinds = mujoco.mjtWarning
        return [kinds(i).name for i in range(kinds.mjNWARNING) if self.data.warning[i].number > 0]


def _idle_stages(model: mujoco.MjModel) -> int:
    """Stages of a step that would find nothing to do, a tenth of its time."""
    bits = mujoco.mjtDisableBit
    # The run ends where a hinge reaches its range, so no limit needs the constraint solver; and the
    # controller measures the state itself.
    idle = bits.mjDSBL_CONSTRAINT | bits.mjDSBL_SENSOR
    if model.nu == 0:
        idle |= bits.mjDSBL_ACTUATION
    if not np.any(model.jnt_stiffness):
        idle |= bits.mjDSBL_SPRING
    if not np.any(model.dof_damping):
        idle |= bits.mjDSBL_DAMPER
    return int(idle)


# A symbol that LLVM resolves by name can be cached; a ctypes function inside compiled code cannot.
llvmlite.binding.add_symbol("mj_step", ctypes.cast(library().mj_step, ctypes.c_void_p).value)
_mj_step = types.ExternalFunction("mj_step", types.void(types.intp, types.intp))


@compiled
def step(engine: Engine) -> None:
    """One physics step of MuJoCo, from compiled code or from Python."""
    _mj_step(engine.model_address, engine.data_address)
