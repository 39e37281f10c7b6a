"""Mass properties and hinge axes of the true rotor that differ from its drawing, for both engines.

An error of the machine is given, or drawn from the seed within a bound. All of them change the compiled
model, at the pose 0: MuJoCo steps it, and the equations of motion of `joint_chain` are read from it. The
controller knows nothing of them. The field of coils and poles is that of the true orientation. The rotor's
displacement is neglected: it is of the size of the offsets of the axes, and a gap that shrinks on one side of
the rotor grows on the other.
"""

from __future__ import annotations

from copy import copy
from typing import Annotated, Any, NamedTuple

import mujoco
import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.electronics.random_streams import UNIFORM, Seed, errors
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.columns import Columns
from spheretwin.models.base.errors import InputError
from spheretwin.models.mjcf import PAYLOAD, ROTOR, Mjcf
from spheretwin.models.mjcf_reader import LARGEST_OFFSET_M, LARGEST_TILT_RAD

LARGEST_CENTRE_m, LARGEST_PRODUCT_kg_m2, LARGEST_RING_kg_m2 = 0.05, 1.0, 1.0
# A given and a drawn error together, in two directions, stay within the bounds of a model file.
TILT_rad, OFFSET_m = 0.35 * LARGEST_TILT_RAD, 0.35 * LARGEST_OFFSET_M

Coordinate = Annotated[float, Field(ge=-LARGEST_CENTRE_m, le=LARGEST_CENTRE_m)]
Product = Annotated[float, Field(ge=-LARGEST_PRODUCT_kg_m2, le=LARGEST_PRODUCT_kg_m2)]
Moment = Annotated[float, Field(ge=0, le=LARGEST_RING_kg_m2)]
Tilt = Annotated[float, Field(ge=-TILT_rad, le=TILT_rad)]
Offset = Annotated[float, Field(ge=-OFFSET_m, le=OFFSET_m)]
Centre = tuple[Coordinate, Coordinate, Coordinate]
Products = tuple[Product, Product, Product]
Rings = tuple[tuple[Moment, Moment, Moment], tuple[Moment, Moment, Moment]]
Tilts = tuple[tuple[Tilt, Tilt], tuple[Tilt, Tilt], tuple[Tilt, Tilt]]
Offsets = tuple[tuple[Offset, Offset], tuple[Offset, Offset], tuple[Offset, Offset]]
ZERO = (0.0, 0.0, 0.0)
PAIRS = ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))


def _error_of(quantity: str, largest: float) -> Any:
    return Field(0.0, ge=0, le=largest, description=f"largest error of {quantity}", json_schema_extra=UNIFORM)


class MassSection(BaseModel):
    """Mass properties and hinge axes of the rotor, in addition to those of the model file, at the pose 0.

    Each error that is drawn from the seed is added to the given value of the same quantity.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    centre_m: Centre = Field(ZERO, description="offset of the rotor's centre of mass along its axes, m")
    centre_error_m: float = _error_of("centre_m, m", LARGEST_CENTRE_m)
    products_kg_m2: Products = Field(
        ZERO, description="entries xy, xz, yz of the inertia tensor about the rotor's centre of mass, kg·m²"
    )
    product_error_kg_m2: float = _error_of("products_kg_m2, kg·m²", LARGEST_PRODUCT_kg_m2)
    ring_inertia_kg_m2: Rings = Field(
        (ZERO, ZERO), description="moments of inertia of outer and inner gimbal ring about x, y, z, kg·m²"
    )
    axis_tilt_rad: Tilts = Field(
        PAIRS, description="tilt of each hinge axis: alpha to y, z; beta to x, z; gamma to x, y; rad"
    )
    axis_tilt_error_rad: float = _error_of("axis_tilt_rad, rad", TILT_rad)
    axis_offset_m: Offsets = Field(
        PAIRS, description="offset of each hinge axis from the joint centre, in the directions of its tilt, m"
    )
    axis_offset_error_m: float = _error_of("axis_offset_m, m", OFFSET_m)


IDEAL = MassSection()


class MassErrors(NamedTuple):
    """Differences of a machine from its model file, at the pose 0; entries as in `MassSection`."""

    centre_m: Array  # (3,)
    products_kg_m2: Array  # (3,)
    axis_tilt_rad: Array  # (3, 2)
    axis_offset_m: Array  # (3, 2)
    ring_inertia_kg_m2: Array  # (2, 3)


def row_of(value: Any, row: int) -> Any:
    """Return the value of a row: from columns or a list, or one that all rows share."""
    if isinstance(value, np.ndarray):
        return value[row, 0]
    return list(value)[row] if isinstance(value, Columns | list) else value


def mass_errors(section: MassSection, seed: Seed) -> Any:
    """Return the differences of a machine from its model file, or a list of those of n machines.

    They are None for a machine without differences, and for all machines of an ideal section.

    Parameters
    ----------
    section : MassSection
    seed : int or (n, 1) array
        Seed of the run; the stream of each quantity is keyed by its name.
    """
    if section == IDEAL:
        return None
    if isinstance(section, Columns) or isinstance(seed, np.ndarray):
        rows = len(section) if isinstance(section, Columns) else np.size(seed)
        return [mass_errors(row_of(section, row), int(row_of(seed, row))) for row in range(rows)]

    def value(name: str, bound: float) -> Array:
        given = np.array(getattr(section, name))
        return given + bound * errors(seed, f"plant.mass.{name}", 1, given.size).reshape(given.shape)

    return MassErrors(
        value("centre_m", section.centre_error_m),
        value("products_kg_m2", section.product_error_kg_m2),
        value("axis_tilt_rad", section.axis_tilt_error_rad),
        value("axis_offset_m", section.axis_offset_error_m),
        np.array(section.ring_inertia_kg_m2),
    )


def true_model(
    mjcf: Mjcf,
    modelling_error: float = 0.0,
    payload_kg: float = 0.0,
    gravity_m_s2: float | None = None,
    mass: MassErrors | None = None,
) -> mujoco.MjModel:
    """Return a copy of a compiled model with the mass properties and the gravity of a run.

    Parameters
    ----------
    mjcf : Mjcf
        Model file; not changed.
    modelling_error : float
        m: the rotor's inertia is (1 + m) times that of the MJCF (11), (54).
    payload_kg : float, kg
        Point mass at the payload mount; 0 for none.
    gravity_m_s2 : float, m/s²
        Gravity along -z; None: that of the model.
    mass : MassErrors
        Differences from the model file; None for none.

    Raises
    ------
    InputError
        The model has no gimbal ring for an inertia, or products of inertia that no rotor can have.
    """
    # Without a payload its empty body is omitted, which saves a twentieth of a step.
    model = copy(mjcf.loaded if payload_kg else mjcf.bare)
    if gravity_m_s2 is not None:
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        model.opt.gravity[:] = 0.0, 0.0, -gravity_m_s2
    model.body_inertia[model.body(ROTOR).id] *= 1 + modelling_error
    if payload_kg:
        payload = model.body(PAYLOAD).id
        model.body_mass[payload] = payload_kg
        model.body_ipos[payload] = 0.0  # the compiler sets another value for a body without mass
    if mass:
        _apply(mass, model)
    return model


def _apply(machine: MassErrors, model: mujoco.MjModel) -> None:
    data, rotor = mujoco.MjData(model), model.body(ROTOR).id
    mujoco.mj_kinematics(model, data)
    model.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE  # else the engine skips these fields
    model.body_ipos[rotor] += machine.centre_m
    xy, xz, yz = machine.products_kg_m2
    _add_inertia(model, rotor, np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]]))
    for hinge, (tilt, offset) in enumerate(zip(machine.axis_tilt_rad, machine.axis_offset_m, strict=True)):
        body, other_axes = model.jnt_bodyid[hinge], np.delete(np.eye(3), hinge, axis=0)
        R = data.xmat[body].reshape(3, 3)
        axis = data.xaxis[hinge] + tilt @ other_axes
        model.jnt_axis[hinge] = R.T @ axis / np.linalg.norm(axis)
        model.jnt_pos[hinge] += R.T @ (offset @ other_axes)
        if hinge < 2 and np.any(inertia := machine.ring_inertia_kg_m2[hinge]):
            if body == model.jnt_bodyid[hinge + 1]:
                raise InputError(
                    "plant.mass.ring_inertia_kg_m2: expected a model with a body for each gimbal ring,"
                    f" received one without a ring at hinge {model.joint(hinge).name}"
                )
            _add_inertia(model, body, R.T * inertia @ R)


def _add_inertia(model: mujoco.MjModel, body: int, tensor: Array) -> None:
    """Add a tensor about the centre of mass of a body, in its frame, to its inertia."""
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, model.body_iquat[body])
    moments, axes = np.linalg.eigh(R.reshape(3, 3) * model.body_inertia[body] @ R.reshape(3, 3).T + tensor)
    if moments[0] <= 0 or moments[0] + moments[1] < moments[2]:
        raise InputError(
            "plant.mass: expected principal inertias above 0 of which none exceeds the sum of the others,"
            f" received {', '.join(f'{moment:.3g}' for moment in moments)} kg·m² for body"
            f" {model.body(body).name}"
        )
    axes[:, 2] *= np.linalg.det(axes)
    model.body_inertia[body] = moments
    mujoco.mju_mat2Quat(model.body_iquat[body], axes.ravel())
