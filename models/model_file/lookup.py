"""Parts and numbers of a compiled model, by their names."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import told_apart

# Lengths of one kind are equal in the MJCF; norms of positions turned by degrees keep 1e-15.
TOLERANCE = 1e-9

# Beyond these a number is a slip of its unit; within them no product or quotient of theirs overflows, and
# the drive takes all that the model file has.
LEAST, LARGEST = 1e-9, 1e9
LEAST_LENGTH_M, LARGEST_LENGTH_M = 1e-6, 1e3


def named(model: mujoco.MjModel, kind: mujoco.mjtObj, label: str, name: str) -> int:
    """Index of the part of this kind and name; `InputError` where there is none."""
    index = mujoco.mj_name2id(model, kind, name)
    if index < 0:
        raise InputError(f'model: expected a {label} named "{name}", received none')
    return index


def body(model: mujoco.MjModel, name: str) -> int:
    """Index of the body of this name."""
    return named(model, mujoco.mjtObj.mjOBJ_BODY, "body", name)


def site(model: mujoco.MjModel, name: str) -> int:
    """Index of the site of this name."""
    return named(model, mujoco.mjtObj.mjOBJ_SITE, "site", name)


def number(model: mujoco.MjModel, name: str) -> float:
    """The custom numeric of this name, refused where it is beyond what its unit can mean."""
    named(model, mujoco.mjtObj.mjOBJ_NUMERIC, "custom numeric", name)
    return within(float(model.numeric(name).data[0]), LEAST, LARGEST, name)


def within(value: float, least: float, largest: float, what: str) -> float:
    """The value itself; `InputError` where it is not within the bounds."""
    if not least <= value <= largest:
        low, high, received = told_apart(least, largest, value)
        raise InputError(f"model: expected {what} from {low} to {high}, received {received}")
    return value


def sites(model: mujoco.MjModel, prefix: str) -> list[int]:
    """Indices of all sites whose names begin so, in the order of the file."""
    found = [i for i in range(model.nsite) if model.site(i).name.startswith(prefix)]
    if not found:
        raise InputError(f'model: expected sites named "{prefix}…", received none')
    return found


def shared(values: NDArray[np.float64], what: str) -> float:
    """The one length, m, that all parts of a kind have; `InputError` where they differ."""
    if np.ptp(values) > TOLERANCE:
        least, largest = told_apart(values.min(), values.max())
        raise InputError(f"model: expected one {what}, received {least} to {largest} m")
    return within(float(values[0]), LEAST_LENGTH_M, LARGEST_LENGTH_M, f"a {what} in metres")
