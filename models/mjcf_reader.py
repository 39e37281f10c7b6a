"""Reader of a compiled MJCF model: named parts, joint and bounds of its numbers."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError, distinct_texts

# Lengths of one kind are equal in the MJCF; norms of positions rotated by degrees have errors of 1e-15.
GEOMETRY_TOLERANCE = 1e-9

# A number beyond these is a mistake of its unit; within them no product or quotient overflows, and the drive
# accepts all values of the model file.
LEAST, LARGEST = 1e-9, 1e9
LEAST_LENGTH_M, LARGEST_LENGTH_M = 1e-6, 1e3


def named(model: mujoco.MjModel, kind: mujoco.mjtObj, label: str, name: str) -> int:
    """Return the index of a part by kind and name; raise `InputError` if there is none."""
    index = mujoco.mj_name2id(model, kind, name)
    if index < 0:
        raise InputError(f'model: expected a {label} named "{name}", received none')
    return index


def body(model: mujoco.MjModel, name: str) -> int:
    """Return the index of the body of a name."""
    return named(model, mujoco.mjtObj.mjOBJ_BODY, "body", name)


def site(model: mujoco.MjModel, name: str) -> int:
    """Return the index of the site of a name."""
    return named(model, mujoco.mjtObj.mjOBJ_SITE, "site", name)


def number(model: mujoco.MjModel, name: str) -> float:
    """Return the custom numeric of a name; raise `InputError` if it is implausible in its unit."""
    named(model, mujoco.mjtObj.mjOBJ_NUMERIC, "custom numeric", name)
    data = model.numeric(name).data
    if len(data) != 1:
        raise InputError(f"model: expected one number {name}, received {len(data)}")
    return within(float(data[0]), LEAST, LARGEST, name)


def within(value: float, least: float, largest: float, what: str) -> float:
    """Return a value; raise `InputError` if it is out of bounds."""
    if not least <= value <= largest:
        low, high, received = distinct_texts(least, largest, value)
        raise InputError(f"model: expected {what} from {low} to {high}, received {received}")
    return value


def sites(model: mujoco.MjModel, prefix: str) -> list[int]:
    """Return the indices of all sites whose names begin with a prefix, in the order of the file."""
    indices = [i for i in range(model.nsite) if model.site(i).name.startswith(prefix)]
    if not indices:
        raise InputError(f'model: expected sites named "{prefix}…", received none')
    return indices


def shared(values: NDArray[np.float64], what: str) -> float:
    """Return the common length, m, of all parts of a kind; raise `InputError` if they differ."""
    if np.ptp(values) > GEOMETRY_TOLERANCE:
        least, largest = distinct_texts(values.min(), values.max())
        raise InputError(f"model: expected one {what}, received {least} to {largest} m")
    return within(float(values[0]), LEAST_LENGTH_M, LARGEST_LENGTH_M, f"a {what} in metres")


HINGES = ("alpha", "beta", "gamma")
LOCKED_DEG = 90.0

# Rotations from degrees have errors of 1e-15.
TOLERANCE = 1e-9

# Beyond these a hinge is another hinge, and its rotor is not at the place of the magnetic model.
LARGEST_TILT_RAD, LARGEST_OFFSET_M = 0.1, 1e-3


def check_joint(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Check the joint: hinges in series about x, y, z through one point, up to errors of manufacture."""
    if model.nv != 3 or model.nq != 3:
        raise InputError(f"model: expected three degrees of freedom, received {model.nv}")
    for i, (name, axis) in enumerate(zip(HINGES, "xyz", strict=True)):
        joint = named(model, mujoco.mjtObj.mjOBJ_JOINT, "joint", name)
        is_hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        along = np.linalg.norm(np.cross(data.xaxis[joint], np.eye(3)[i])) <= np.sin(LARGEST_TILT_RAD)
        offset = data.xanchor[joint] - data.xaxis[joint] * (data.xanchor[joint] @ data.xaxis[joint])
        centred = np.linalg.norm(offset) <= LARGEST_OFFSET_M and data.xaxis[joint][i] > 0
        in_series = model.dof_parentid[i] == i - 1
        if not (joint == i and is_hinge and along and centred and in_series):
            raise InputError(
                f"model: expected joint {i + 1} to be hinge {name} about {axis} through the origin, within"
                f" {LARGEST_TILT_RAD:g} rad and {LARGEST_OFFSET_M:g} m"
            )
    if np.any(model.qpos0):
        raise InputError(f"model: expected hinges without ref, received {np.degrees(model.qpos0)} degrees")
    payload = body(model, "payload")
    mass, inertia = model.body_mass[payload], model.body_inertia[payload].max()
    if mass > 0 or inertia > 0:
        raise InputError(
            "model: expected an empty payload mount, whose mass a run sets by plant.payload_kg,"
            f" received {mass:g} kg and {inertia:g} kg·m²"
        )
    rotor = body(model, "rotor")
    upright = np.allclose(data.xmat[rotor], np.eye(3).ravel(), atol=TOLERANCE)
    if not upright or np.linalg.norm(data.xpos[rotor]) > LARGEST_OFFSET_M:
        raise InputError(
            "model: expected the rotor's frame to be that of the stator at angles of 0, its origin within"
            f" {LARGEST_OFFSET_M:g} m"
        )
    range_deg = np.degrees(hinge_range(model)[1])
    if np.any(np.abs(range_deg) >= LOCKED_DEG):
        least, largest, low, high = distinct_texts(-LOCKED_DEG, LOCKED_DEG, *range_deg)
        raise InputError(
            f"model: expected a range of beta inside {least} to {largest} degrees, where the joint locks,"
            f" received {low} to {high}"
        )


def check_bounded(model: mujoco.MjModel) -> None:
    """Check that the numbers of a model are finite and plausible in their units."""
    arrays = {
        name: getattr(model, name)
        for name in (
            "body_mass",
            "body_inertia",
            "body_ipos",
            "body_pos",
            "site_pos",
            "site_size",
            "jnt_range",
        )
    }
    for name, numbers in {**arrays, "gravity": model.opt.gravity}.items():
        if not np.all(np.isfinite(numbers)):
            raise InputError(f"model: expected finite numbers, received NaN or infinity in {name}")
        if np.any(np.abs(numbers) > LARGEST):
            largest, received = distinct_texts(LARGEST, numbers.flat[np.argmax(np.abs(numbers))])
            raise InputError(f"model: expected numbers of at most {largest}, received {received} in {name}")


def hinge_range(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return least and greatest angle of each hinge, (3, 2) in rad; infinite for a free hinge."""
    joints = [named(model, mujoco.mjtObj.mjOBJ_JOINT, "joint", name) for name in HINGES]
    limited = model.jnt_limited[joints].astype(bool)[:, None]
    return np.where(limited, model.jnt_range[joints], [-np.inf, np.inf])
