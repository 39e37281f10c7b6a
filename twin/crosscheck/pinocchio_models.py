"""Models of Pinocchio: from the model file, or from the bodies of a compiled model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.models.mjcf import PAYLOAD, gravity, read


def model_of_file(mjcf: Path, modelling_error: float, payload_kg: float) -> tuple[Any, int]:
    """Return the model that Pinocchio reads from a file, with another rotor, and its joint γ.

    Raises
    ------
    ImportError
        Pinocchio is not installed.
    InputError
        It cannot read the model.
    """
    import pinocchio  # of the test group: nothing else needs it

    try:
        model = pinocchio.buildModelFromMJCF(str(mjcf))
    except (ValueError, RuntimeError) as error:
        raise InputError(
            f"model {mjcf}: expected MJCF that Pinocchio reads, {without_breaks(error)}"
        ) from None
    model.gravity.linear = np.array(gravity(read(mjcf).described.opt))
    joint = model.getJointId("gamma")
    model.inertias[joint].inertia = (1 + modelling_error) * model.inertias[joint].inertia
    if payload_kg:
        mount = read(mjcf).loaded.body(PAYLOAD).pos
        point = pinocchio.Inertia(payload_kg, mount, np.zeros((3, 3)))
        model.appendBodyToJoint(joint, point, pinocchio.SE3.Identity())
    return model, joint


def model_of_bodies(model: mujoco.MjModel) -> tuple[Any, int]:
    """Return a model of Pinocchio with axes and bodies of a compiled one at the pose 0, and its joint γ."""
    import pinocchio  # of the test group: nothing else needs it

    start = mujoco.MjData(model)
    mujoco.mj_forward(model, start)
    chain, here, placed = pinocchio.Model(), np.zeros(3), {0: 0}
    chain.gravity.linear = model.opt.gravity.copy()
    for body in range(1, model.nbody):
        placed[body] = placed[model.body_parentid[body]]
        if model.body_jntnum[body]:
            hinge, before = model.body_jntadr[body], here
            here = start.xanchor[hinge].copy()
            axis = pinocchio.JointModelRevoluteUnaligned(start.xaxis[hinge].copy())
            offset = pinocchio.SE3(np.eye(3), here - before)
            placed[body] = chain.addJoint(placed[body], axis, offset, model.joint(hinge).name)
        if placed[body] and model.body_mass[body]:
            turn = start.ximat[body].reshape(3, 3)
            tensor = turn @ np.diag(model.body_inertia[body]) @ turn.T
            inertia = pinocchio.Inertia(model.body_mass[body], start.xipos[body] - here, tensor)
            chain.appendBodyToJoint(placed[body], inertia, pinocchio.SE3.Identity())
    return chain, chain.getJointId("gamma")
