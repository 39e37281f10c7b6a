"""Configuration of the plugin: config attributes of an instance, and its parts of the model."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from spheretwin.models import actuator as actuators
from spheretwin.models import torque_curve, torque_field
from spheretwin.models.actuator import Actuator, groups_of, polarities
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.coil_group import of_each_group
from spheretwin.models.mjcf_reader import named, sites

Addresses = NDArray[np.int64]

PLUGIN = "spheretwin.coils"

Positive = Annotated[float, Field(gt=0)]

QUANTITIES = ("current", "emf", "torque")
"""Ends of the names of its sensors."""
CURRENT, EMF, TORQUE = range(3)

# Axes of hinges are exact in MJCF; those of sites come from rotations of degrees.
TOLERANCE = 1e-9


def _words(text: object) -> object:
    return text.split() if isinstance(text, str) else text


class Attributes(BaseModel):
    """Config attributes of an instance of the plugin."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    hinges: Annotated[tuple[str, str, str], BeforeValidator(_words)] = Field(
        ("alpha", "beta", "gamma"), description="three names of hinges, about x, y and z"
    )
    poles: str = Field("pole_", description="start of the names of the sites of the poles, in the rotor")
    coils: str = Field("coil_", description="start of the names of the sites of the coils, in the stator")
    curve: Path = Field(
        actuators.TORQUE_CURVE_PATH, description="file of a torque curve or of a torque field, CSV"
    )
    gain: Annotated[tuple[float, ...], BeforeValidator(_words)] = Field(
        (1.0,), description="one number or one for each group, the torque per ampere over that of the curve"
    )
    input: Literal["current", "voltage"] = Field(
        "current", description="current or voltage, the quantity of the controls"
    )
    # Those of the shipped actuator, a hand estimate (models/README.md).
    resistance_ohm: Annotated[tuple[Positive, ...], BeforeValidator(_words)] = Field(
        (1.3,), description="a number above 0 or one for each group, with the input voltage"
    )
    inductance_H: Annotated[tuple[Positive, ...], BeforeValidator(_words)] = Field(
        (0.9e-3,), description="a number above 0 or one for each group, with the input voltage"
    )


class Parts(NamedTuple):
    """Parts of a model that belong to an instance; addresses are those of its arrays in `mjData`."""

    attributes: Attributes
    actuator: Actuator
    gain: Array  # (n,)
    resistance_ohm: Array  # (n,)
    inductance_H: Array  # (n,)
    qpos: Addresses  # (3,) of the hinges
    qvel: Addresses  # (3,)
    ctrl: Addresses  # (n,)
    ctrl_range: Array  # (n, 2); infinite without a limit
    act: Addresses  # (n,); -1 if the controls act at once
    force: Addresses  # (n,) of the actuators
    sensors: Addresses  # (k, 2) number of the quantity, address


def read(model: mujoco.MjModel, instance: int, texts: dict[str, str]) -> Parts:
    """Return the parts of an instance.

    Parameters
    ----------
    model : MjModel
    instance : int
        Number of the instance.
    texts : dict
        Its config attributes; an empty text stands for the default.

    Raises
    ------
    InputError
        An attribute is invalid, or the model lacks a part.
    """
    own = np.flatnonzero(model.actuator_plugin == instance)
    attributes = _attributes({name: text for name, text in texts.items() if text})
    attributes = _with_prefix(attributes, _prefix(model, own, attributes.hinges[0]))
    hinges = _hinges(model, attributes.hinges)
    actuator = _actuator(model, attributes, *model.jnt_bodyid[hinges[[0, 2]]])
    groups = len(actuator.groups)
    for name in ("gain", "resistance_ohm", "inductance_H"):
        if (count := len(getattr(attributes, name))) not in (1, groups):
            raise InputError(f"{name}: expected one number or {groups}, received {count}")
    if len(own) != groups:
        raise InputError(f"expected {groups} actuators, one for each group of coils, received {len(own)}")
    _check_actuators(model, own, hinges, attributes.input)
    ctrl = model.actuator_ctrladr[own].astype(np.int64)
    limited = model.actuator_ctrllimited[ctrl].astype(bool) & (
        not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
    )
    return Parts(
        attributes=attributes,
        actuator=actuator,
        gain=of_each_group(attributes.gain, groups),
        resistance_ohm=of_each_group(attributes.resistance_ohm, groups),
        inductance_H=of_each_group(attributes.inductance_H, groups),
        qpos=model.jnt_qposadr[hinges].astype(np.int64),
        qvel=model.jnt_dofadr[hinges].astype(np.int64),
        ctrl=ctrl,
        ctrl_range=np.where(limited[:, None], model.actuator_ctrlrange[ctrl], [-np.inf, np.inf]),
        act=model.actuator_actadr[own].astype(np.int64),
        force=model.actuator_outadr[own].astype(np.int64),
        sensors=_sensors(model, instance),
    )


def quantity_of(model: mujoco.MjModel, sensor: int) -> int:
    """Return the number of the quantity of a sensor, from the end of its name.

    Raises
    ------
    InputError
        The name ends with none of them.
    """
    name = model.sensor(sensor).name
    for number, quantity in enumerate(QUANTITIES):
        if name.endswith(quantity):
            return number
    raise InputError(
        f"sensor: expected a name that ends with {', '.join(QUANTITIES)}, received {name or 'none'}"
    )


def _attributes(texts: dict[str, str]) -> Attributes:
    try:
        return Attributes.model_validate(texts)
    except ValidationError as error:
        name = str(error.errors()[0]["loc"][0])
        meaning = Attributes.model_fields[name].description
        raise InputError(f"{name}: expected {meaning}; received {shown(texts[name])}") from None


def _prefix(model: mujoco.MjModel, actuators: NDArray[np.int64], hinge: str) -> str:
    """Return the prefix that an attachment has put before the names of a model, but not into attributes.

    It is that of the hinge in the transmission of the actuators; empty if no hinge there has such a name.
    """
    for tendon in model.actuator_trnid[actuators[:1], 0]:
        first = model.tendon_adr[tendon]
        for joint in model.wrap_objid[first : first + model.tendon_num[tendon]]:
            name = model.joint(joint).name
            if name.endswith(hinge):
                return str(name.removesuffix(hinge))
    return ""


def _with_prefix(attributes: Attributes, prefix: str) -> Attributes:
    names = {"poles": prefix + attributes.poles, "coils": prefix + attributes.coils}
    return attributes.model_copy(
        update={**names, "hinges": tuple(prefix + name for name in attributes.hinges)}
    )


def _hinges(model: mujoco.MjModel, names: tuple[str, ...]) -> NDArray[np.int64]:
    """Return the numbers of three hinges in series about x, y and z."""
    numbers = np.array([named(model, mujoco.mjtObj.mjOBJ_JOINT, "joint", name) for name in names])
    for place, (number, axis) in enumerate(zip(numbers, np.eye(3), strict=True)):
        is_hinge = model.jnt_type[number] == mujoco.mjtJoint.mjJNT_HINGE
        along = np.allclose(model.jnt_axis[number], axis, atol=TOLERANCE)
        body, dof = model.jnt_bodyid[number], model.jnt_dofadr[number]
        in_series = not place or model.dof_parentid[dof] == model.jnt_dofadr[numbers[place - 1]]
        upright = not place or np.allclose(np.abs(model.body_quat[body]), [1, 0, 0, 0], atol=TOLERANCE)
        if not (is_hinge and along and in_series and upright):
            raise InputError(
                f"hinges: expected {names[place]} as hinge number {place + 1} of three in series about x, y"
                " and z, received another joint or axis"
            )
    return numbers


def _actuator(model: mujoco.MjModel, attributes: Attributes, outer: int, rotor: int) -> Actuator:
    """Return the actuator with the poles and coils of the model, and otherwise the shipped one."""
    stator = model.body_parentid[outer]
    poles, coils = sites(model, attributes.poles), sites(model, attributes.coils)
    for numbers, body, prefix in ((poles, rotor, attributes.poles), (coils, stator, attributes.coils)):
        if np.any(model.site_bodyid[numbers] != body):
            name = model.body(body).name
            raise InputError(f'sites: expected those named "{prefix}…" in the body {name}, received others')
    coil_axes = _axes(model, coils)
    text = torque_curve.read_bytes(attributes.curve)
    groups, direction = groups_of(model, coils, coil_axes, torque_field.parse(attributes.curve, text))
    return _cached(
        _axes(model, poles).tobytes(),
        polarities(model, poles).tobytes(),
        coil_axes.tobytes(),
        direction.tobytes(),
        groups.tobytes(),
        groups.shape[1],
        attributes.curve,
        text,
    )


@lru_cache(maxsize=8)
def _cached(
    poles: bytes,
    polarity: bytes,
    coils: bytes,
    direction: bytes,
    groups: bytes,
    size: int,
    curve: Path,
    text: bytes,
) -> Actuator:
    """Return one object for equal parts: the cache of torque models depends on its identity."""
    return replace(
        actuators.load(),
        pole_axes=np.frombuffer(poles).reshape(-1, 3),
        pole_polarity=np.frombuffer(polarity),
        coil_axes=np.frombuffer(coils).reshape(-1, 3),
        coil_direction=np.frombuffer(direction),
        groups=np.frombuffer(groups, np.int64).reshape(-1, size),
        torque_data=torque_field.parse(curve, text),
    )


def _axes(model: mujoco.MjModel, numbers: list[int]) -> Array:
    """Return the z axes of sites in the frame of their body, (k, 3)."""
    axes, R = np.empty((len(numbers), 3)), np.empty(9)
    for row, number in enumerate(numbers):
        mujoco.mju_quat2Mat(R, model.site_quat[number])
        axes[row] = R.reshape(3, 3)[:, 2]
    return axes


def _check_actuators(
    model: mujoco.MjModel, own: NDArray[np.int64], hinges: NDArray[np.int64], input: str
) -> None:
    has_dynamics = model.actuator_dyntype[own] != mujoco.mjtDyn.mjDYN_NONE
    states = np.ones(len(own)) if input == "voltage" else has_dynamics
    if np.any(model.actuator_actnum[own] != states) or (input == "voltage" and np.any(has_dynamics)):
        expected = 'actdim="1" and no dyntype' if input == "voltage" else "actdim only with a dyntype"
        raise InputError(f"actuators: expected {expected} with the input {input}")
    if np.any(model.actuator_delay[own]):
        raise InputError("actuators: expected no delay")
    for number in own:
        tendon = model.actuator_trnid[number, 0]
        is_tendon = model.actuator_trntype[number] == mujoco.mjtTrn.mjTRN_TENDON
        wrapped = slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
        if not is_tendon or sorted(model.wrap_objid[wrapped]) != sorted(hinges):
            raise InputError("actuators: expected a fixed tendon over the three hinges as transmission")


def _sensors(model: mujoco.MjModel, instance: int) -> Addresses:
    own = np.flatnonzero(model.sensor_plugin == instance)
    rows = [(quantity_of(model, int(sensor)), model.sensor_adr[sensor]) for sensor in own]
    return np.array(rows, np.int64).reshape(-1, 2)
