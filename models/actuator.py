"""Actuator data: read once from the MJCF and the torque curve, then immutable."""

from __future__ import annotations

from collections.abc import Mapping, Sized
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from types import MappingProxyType

import mujoco
import numpy as np
from numpy.typing import NDArray

from spheretwin.models import torque_curve, torque_field
from spheretwin.models.base.errors import InputError, distinct_texts
from spheretwin.models.coil_group import CoilGroup, read_group, read_heat
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet, check_cylinders, read_coil, read_magnet
from spheretwin.models.mjcf import Mjcf, read
from spheretwin.models.mjcf_reader import (
    body,
    check_bounded,
    check_joint,
    hinge_range,
    site,
    sites,
)
from spheretwin.models.torque_curve import TorqueCurve
from spheretwin.models.torque_field import TorqueData

FOLDER = Path(__file__).resolve().parent
MJCF_PATH = FOLDER / "actuator.xml"
TORQUE_CURVE_PATH = FOLDER / "torque_curve.csv"

TORQUE_FILE = "torque_file"

# Axes of one group are exact opposites in the MJCF; rotations from degrees have errors of 1e-15.
COLLINEAR_TOLERANCE = 1e-9

# A torque has three components.
LEAST_GROUPS = 3


@dataclass(frozen=True, eq=False)
class Actuator:
    """Geometry, inertia, magnets and coils of the actuator.

    Attributes
    ----------
    inertia : (3,) array, kg·m²
        Moments of inertia of the rotor about its axes through the joint centre: the principal ones if its
        centre of mass is there and its products of inertia are 0.
    pole_axes : (p, 3) array
        Unit vectors, rotor frame, pointing outward.
    pole_polarity : (p,) array
        +1 where the north pole points outward, -1 where the south pole does.
    coil_axes : (c, 3) array
        Unit vectors, stator frame, pointing outward.
    coil_direction : (c,) array
        +1 where a positive current of the group runs counterclockwise about the outward axis, else -1.
    groups : (n, c/n) int array
        The coils of each group, as indices into the coils.
    hinge_range_rad : (3, 2) array, rad
        Least and greatest angle of each hinge; infinite for a free hinge.
    shaft_tip_m, payload_mount_m : (3,) array, m
        In the rotor frame.
    magnet, coil
        Geometry shared by all poles and by all coils.
    group
        Electrical and thermal data of the groups.
    heat
        Thermal data of stator and rotor that the model file states, by the name of the number.
    torque_data
        Torque of one coil per ampere: on one pole, or on the rotor.
    """

    inertia: NDArray[np.float64]
    pole_axes: NDArray[np.float64]
    pole_polarity: NDArray[np.float64]
    coil_axes: NDArray[np.float64]
    coil_direction: NDArray[np.float64]
    groups: NDArray[np.int64]
    hinge_range_rad: NDArray[np.float64]
    shaft_tip_m: NDArray[np.float64]
    payload_mount_m: NDArray[np.float64]
    magnet: Magnet
    coil: CoilGeometry
    group: CoilGroup
    heat: Mapping[str, float]
    torque_data: TorqueData

    @property
    def group_axes(self) -> NDArray[np.float64]:
        """(n, 3) array: axis of the first coil of each group, stator frame."""
        return self.coil_axes[self.groups[:, 0]]

    @property
    def torque_curve(self) -> TorqueCurve:
        """Torque curve.

        Raises
        ------
        InputError
            The actuator has a torque field instead.
        """
        if not isinstance(self.torque_data, TorqueCurve):
            raise InputError(f"model: expected a torque curve here, received the {self.torque_data.name}")
        return self.torque_data

    def of_groups(self, of_coils: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the torque matrix, (3, n), of the torques of the coils, (c, 3)."""
        return np.asarray((self.coil_direction[:, None] * of_coils)[self.groups].sum(axis=1).T)


def load(mjcf: Path = MJCF_PATH, curve: Path | None = None) -> Actuator:
    """Read the actuator from its MJCF and its torque curve or field.

    Parameters
    ----------
    mjcf : Path
        Model file; the shipped one unless given.
    curve : Path
        Torque curve or torque field as CSV. Unless given, the file next to the model file that its custom
        text `torque_file` names, or the shipped curve if it names none.

    Raises
    ------
    InputError
        A file cannot be read, or the model lacks a part of the actuator.
    """
    if mjcf == MJCF_PATH and curve in (None, TORQUE_CURVE_PATH):
        return _shipped()  # read once; other files, and their includes, may change during the process
    model = read(mjcf)
    path = curve or torque_path(mjcf, model.described)
    return _cached(model, path, torque_curve.read_bytes(path))


def torque_path(mjcf: Path, model: mujoco.MjModel) -> Path:
    """Return the torque curve or field that a model file names, or the shipped curve."""
    text = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, TORQUE_FILE)
    if text < 0:
        return TORQUE_CURVE_PATH
    first = int(model.text_adr[text])
    return mjcf.parent / model.text_data[first:].split(b"\0", 1)[0].decode()


@lru_cache(maxsize=8)
def _cached(mjcf: Mjcf, curve: Path, content: bytes) -> Actuator:
    """Return one object for unchanged files: caches depend on the identity of the actuator."""
    return from_model(mjcf.described, torque_field.parse(curve, content))


def from_model(model: mujoco.MjModel, torque_data: TorqueData) -> Actuator:
    """Read the actuator from a compiled model.

    Raises
    ------
    InputError
        The model is not a rotor on three hinges about x, y, z amid groups of coils, its coils are no
        cylinders, or it has a torque curve and groups that are not two opposite coils, or poles that are no
        cylinders.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    check_bounded(model)
    check_joint(model, data)
    poles = sites(model, "pole_")
    coils = sites(model, "coil_")
    if isinstance(torque_data, TorqueCurve):
        check_cylinders(model, poles)
    R_SR = data.body(body(model, "rotor")).xmat.reshape(3, 3)
    coil_axes = _frozen(_outward_axes(data, coils))
    groups, direction = groups_of(model, coils, coil_axes, torque_data)
    return Actuator(
        inertia=_frozen(_inertia(model, body(model, "rotor"))),
        pole_axes=_frozen(_outward_axes(data, poles) @ R_SR),
        pole_polarity=_frozen(polarities(model, poles)),
        coil_axes=coil_axes,
        coil_direction=_frozen(direction),
        groups=_frozen(groups),
        hinge_range_rad=_frozen(hinge_range(model)),
        shaft_tip_m=_frozen(model.site_pos[site(model, "shaft_tip")]),
        payload_mount_m=_frozen(model.body_pos[body(model, "payload")]),
        magnet=read_magnet(model, poles),
        coil=read_coil(model),
        group=read_group(model, len(groups)),
        heat=MappingProxyType(read_heat(model)),
        torque_data=torque_data,
    )


@cache
def _shipped() -> Actuator:
    return from_model(read(MJCF_PATH).described, torque_curve.read(TORQUE_CURVE_PATH))


def _frozen(values: NDArray) -> NDArray:
    copy = np.array(values)
    copy.flags.writeable = False
    return copy


def _inertia(model: mujoco.MjModel, rotor: int) -> NDArray[np.float64]:
    """Return the diagonal of the inertia tensor about the origin of a body, along its axes."""
    R, centre = np.empty(9), model.body_ipos[rotor]
    mujoco.mju_quat2Mat(R, model.body_iquat[rotor])
    tensor = R.reshape(3, 3) * model.body_inertia[rotor] @ R.reshape(3, 3).T
    return np.diag(tensor) + model.body_mass[rotor] * (centre @ centre - centre**2)


def _outward_axes(data: mujoco.MjData, sites: list[int]) -> NDArray[np.float64]:
    return data.site_xmat[sites].reshape(-1, 3, 3)[:, :, 2]


def polarities(model: mujoco.MjModel, poles: list[int]) -> NDArray[np.float64]:
    """Return the polarity of the sites of poles, +1 or -1: their user values."""
    polarity = model.site_user[poles, 0] if model.nuser_site else np.zeros(len(poles))
    for pole, value in zip(poles, polarity, strict=True):
        if value not in (-1.0, 1.0):
            north, south, received = distinct_texts(1.0, -1.0, value)
            raise InputError(
                f"model: expected polarity {north} or {south} as user value of {model.site(pole).name},"
                f" received {received}"
            )
    return polarity


def groups_of(
    model: mujoco.MjModel, coils: list[int], axes: NDArray[np.float64], torque_data: TorqueData
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the coils (sites) of each group, (n, k), and the direction of the current in each coil.

    Raises
    ------
    InputError
        The groups are invalid, or not two opposite coils with a torque curve.
    """
    groups, direction = _groups(model, coils, axes)
    if isinstance(torque_data, TorqueCurve):
        _check_opposite(groups, direction, axes)
    return groups, direction


def _groups(
    model: mujoco.MjModel, coils: list[int], axes: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the coils of each group, and the direction of the current in each coil.

    The user value of a coil is the number of its group from 1 on, negative for the opposite direction of the
    current. Without user values a group is two opposite coils.
    """
    number = model.site_user[coils, 0] if model.nuser_site else np.zeros(len(coils))
    if not np.any(number):
        return _collinear_pairs(model, coils, axes), np.ones(len(coils))
    of_coil = np.abs(number)
    count = int(min(of_coil.max(), len(coils)))
    groups = [np.flatnonzero(of_coil == group + 1) for group in range(count)]
    sizes = {len(group) for group in groups}
    if sum(map(len, groups)) != len(coils) or len(sizes) > 1:
        raise InputError(
            "model: expected as user value of each coil the number of its group, from 1 on, with a sign, and"
            f" equally many coils in each group, received {', '.join(f'{value:g}' for value in number)}"
        )
    _check_count(groups)
    return np.array(groups), np.sign(number)


def _check_count(groups: Sized) -> None:
    if len(groups) < LEAST_GROUPS:
        raise InputError(f"model: expected at least {LEAST_GROUPS} groups of coils, received {len(groups)}")


def _check_opposite(
    groups: NDArray[np.int64], direction: NDArray[np.float64], axes: NDArray[np.float64]
) -> None:
    """Check that each group is two opposite coils with currents of one direction: a torque curve needs it."""
    pairs = groups.shape[1] == 2 and bool(np.all(direction == 1))
    if not pairs or np.any(
        np.sum(axes[groups[:, 0]] * axes[groups[:, 1]], axis=1) > -1 + COLLINEAR_TOLERANCE
    ):
        raise InputError(
            "model: expected groups of two opposite coils for a torque curve, received other groups; a torque"
            " field admits any"
        )


def _collinear_pairs(model: mujoco.MjModel, coils: list[int], axes: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the groups: two coils in series whose axes are exact opposites."""
    opposite = axes @ axes.T < -1 + COLLINEAR_TOLERANCE
    for index, count in enumerate(opposite.sum(axis=1)):
        if count != 1:
            name = model.site(coils[index]).name
            raise InputError(f"model: expected one coil opposite {name}, received {count}")
    partner = np.argmax(opposite, axis=1)
    groups = np.array([[i, j] for i, j in enumerate(partner) if i < j])
    _check_count(groups)
    return groups
