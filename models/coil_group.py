"""Electrical and thermal data in a model file; of the coil groups one value of all, or one for each."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin.models.base.errors import InputError, did_you_mean, distinct_texts
from spheretwin.models.mjcf_reader import LARGEST, LEAST, named, within

PerGroup = float | tuple[float, ...]
"""One value of all groups, or one for each."""

# Beyond this an inductance or a resistance is a mistake of its unit.
LONGEST_TIME_CONSTANT_S = 1e3

ELECTRICAL = {"resistance_ohm": (LEAST, LARGEST), "inductance_H": (LEAST, LARGEST)}
"""Bounds of the numbers that a model file must state, by name without `PREFIX`."""
LIMIT = "current_limit_A"
THERMAL = {
    "resistance_per_K": (0.0, 0.01),
    "heat_capacity_J_K": (1e-3, 1e6),
    "thermal_resistance_K_W": (0.0, 1e6),
    "temperature_limit_degC": (-60.0, 1e4),
}
"""Bounds of the numbers that a model file may state."""

PREFIX = "group_"

HEAT = {
    "magnet_remanence_per_K": (-0.01, 0.0),
    "magnet_temperature_limit_degC": (-60.0, 300.0),
    "stator_heat_capacity_J_K": (1e-3, 1e7),
    "rotor_heat_capacity_J_K": (1e-3, 1e7),
    "stator_to_ambient_K_W": (1e-6, 1e6),
    "air_gap_K_W": (1e-6, 1e6),
    "rotor_to_ambient_K_W": (1e-6, 1e6),
}
"""Bounds of the thermal data of stator and rotor that a model file may state."""

THERMAL_UNITS = ("_per_K", "_J_K", "_K_W", "_degC")


@dataclass(frozen=True)
class CoilGroup:
    """Data of the groups, each of coils in series; None for thermal data that the file does not state."""

    resistance_ohm: PerGroup
    """At 20 °C."""
    inductance_H: PerGroup
    current_limits_A: PerGroup
    resistance_per_K: PerGroup | None = None
    heat_capacity_J_K: PerGroup | None = None
    thermal_resistance_K_W: PerGroup | None = None
    temperature_limit_degC: PerGroup | None = None

    @property
    def current_limit_A(self) -> float:
        """Limit that holds for all groups: the smallest."""
        return float(np.min(self.current_limits_A))


def per_group(values: ArrayLike) -> PerGroup:
    """Return one value of all groups if all are equal, otherwise one for each."""
    first, *others = np.ravel(values).tolist()
    return first if all(other == first for other in others) else (first, *others)


def of_each_group(value: ArrayLike, groups: int) -> NDArray[np.float64]:
    """Return the value of each group, (n,)."""
    return np.array(np.broadcast_to(value, groups), np.float64)


def read_group(model: mujoco.MjModel, groups: int) -> CoilGroup:
    """Read the data of the groups from the custom numbers of a compiled model.

    Raises
    ------
    InputError
        A number is missing, out of bounds or unknown, there is neither one for all groups nor one for each,
        or a time constant is implausible.
    """
    _check_names(model)
    stated = {
        name: _numbers(model, PREFIX + name, groups, bounds)
        for name, bounds in {**ELECTRICAL, LIMIT: (LEAST, LARGEST), **THERMAL}.items()
        if name not in THERMAL or _index(model, PREFIX + name) >= 0
    }
    limits_A = stated.pop(LIMIT)
    group = CoilGroup(current_limits_A=limits_A, **stated)
    longest_s = float(np.max(np.divide(group.inductance_H, group.resistance_ohm)))
    if longest_s > LONGEST_TIME_CONSTANT_S:
        longest, received = distinct_texts(LONGEST_TIME_CONSTANT_S, longest_s)
        raise InputError(
            f"model: expected group_inductance_H / group_resistance_ohm of at most {longest} s,"
            f" received {received}"
        )
    return group


def read_heat(model: mujoco.MjModel) -> dict[str, float]:
    """Read the thermal data of stator and rotor that a compiled model states.

    Raises
    ------
    InputError
        A number is out of bounds.
    """
    return {
        name: float(np.max(_numbers(model, name, 1, bounds)))
        for name, bounds in HEAT.items()
        if _index(model, name) >= 0
    }


def _index(model: mujoco.MjModel, name: str) -> int:
    return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name))


def _check_names(model: mujoco.MjModel) -> None:
    """Check that no number has a name like those of groups or of thermal data, which would be ignored."""
    known = [*(PREFIX + name for name in (*ELECTRICAL, LIMIT, *THERMAL)), *HEAT]
    for name in (model.numeric(number).name for number in range(model.nnumeric)):
        is_of_the_machine = name.startswith(PREFIX) or name.endswith(THERMAL_UNITS)
        if is_of_the_machine and name not in known:
            raise InputError(
                f"model: expected electrical and thermal data among {', '.join(known)}, received {name}"
                f"{did_you_mean(name, known)}"
            )


def _numbers(model: mujoco.MjModel, name: str, groups: int, bounds: tuple[float, float]) -> PerGroup:
    named(model, mujoco.mjtObj.mjOBJ_NUMERIC, "custom numeric", name)
    values = [within(float(value), *bounds, name) for value in model.numeric(name).data]
    if len(values) not in (1, groups):
        each = f" or one for each of {groups} groups" if groups > 1 else ""
        raise InputError(f"model: expected {name} as one number{each}, received {len(values)} numbers")
    return per_group(values)
