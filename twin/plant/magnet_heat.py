"""Temperatures of stator and rotor, and the remanence of the magnets at the rotor's temperature.

The windings release heat to the stator, the stator to its surroundings and through the air gap to the rotor,
the rotor to its surroundings through shaft and air. Stator and rotor have one temperature each:

    C_s dT_s/dt = P - (T_s - T_r) / R_g - (T_s - T_0) / R_s
    C_r dT_r/dt = (T_s - T_r) / R_g - (T_r - T_0) / R_r

Torque and back-EMF fall with the remanence, ``1 + a (T_r - 20 °C)``. Losses in the magnets and in the
bearings are neglected: eddy currents are below 1 mW at 1 rad/s, friction is below 10 mW.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.electronics.coil import GroupCoils, REFERENCE_degC
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.coil_group import PerGroup
from spheretwin.plant.plant_part import PlantPart, PlantSetup

Capacity = Annotated[float, Field(ge=1e-3, le=1e7)]
Resistance = Annotated[float, Field(ge=1e-6, le=1e6)]


class ThermalSection(BaseModel):
    """Temperatures of stator and rotor."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    on: bool = Field(
        False, description="the losses of the windings heat stator and rotor; needs drive.supply_V"
    )
    remanence_per_K: Annotated[float, Field(ge=-0.01, le=0)] | None = Field(
        None,
        description="relative change of the remanence, 1/K, from 20 °C; the model file's unless given"
        " (assumed: -0.0011; sintered NdFeB: -0.0011 to -0.0012; Arnold Magnetic Technologies, catalogue of"
        " NdFeB magnets, N35: -0.0012)",
    )
    knee_degC: Annotated[float, Field(ge=-60, le=300)] | None = Field(
        None,
        description="temperature of the rotor above which magnets may be demagnetised, °C: a run that exceeds"
        " it has a warning; the temperature limit of the magnets in the model file unless given (assumed: 80,"
        " the same catalogue, N35)",
    )
    rotor_degC: Annotated[float, Field(ge=-60, le=300)] | None = Field(
        None, description="initial temperature of the rotor, °C; drive.ambient_degC unless given"
    )
    stator_heat_capacity_J_K: Capacity | None = Field(
        None, description="heat capacity of the stator, J/K; the model file's unless given (assumed: 1000)"
    )
    rotor_heat_capacity_J_K: Capacity | None = Field(
        None, description="heat capacity of the rotor, J/K; the model file's unless given (assumed: 900)"
    )
    stator_to_ambient_K_W: Resistance | None = Field(
        None,
        description="thermal resistance from stator to surroundings, K/W; the model file's unless given"
        " (assumed: 0.8)",
    )
    air_gap_K_W: Resistance | None = Field(
        None,
        description="thermal resistance from stator to rotor, K/W; the model file's unless given"
        " (assumed: 2)",
    )
    rotor_to_ambient_K_W: Resistance | None = Field(
        None,
        description="thermal resistance from rotor to surroundings, K/W; the model file's unless given"
        " (assumed: 5)",
    )


class ResolvedThermal(ThermalSection):
    """Temperatures of stator and rotor of a run: thermal data of the machine are given."""

    remanence_per_K: float
    knee_degC: float
    stator_heat_capacity_J_K: float
    rotor_heat_capacity_J_K: float
    stator_to_ambient_K_W: float
    air_gap_K_W: float
    rotor_to_ambient_K_W: float


class MagnetHeat(Record):
    """Heat of stator and rotor with its state."""

    on: bool = field("whether temperatures are computed")
    remanence_per_K: float = field("relative change of the remanence", "1/K")
    ambient_degC: float = field("temperature of the surroundings", "°C")
    winding_J_K: Array = field("heat capacity of the winding of each group", "J/K", "groups")
    period_s: float = field("control period", "s")
    matrix_W_K: Array = field("C / h and conductances, of stator and rotor", "W/K", (2, 2))
    capacity_W_K: Array = field("C / h", "W/K", 2)
    to_ambient_W_K: Array = field("conductance to the surroundings", "W/K", 2)
    stator_degC: float = field(
        "temperature of the stator, the surroundings of the windings", "°C", state=True
    )
    rotor_degC: float = field("temperature of the rotor", "°C", state=True)
    last_degC: Array = field("windings at the end of the last period", "°C", "groups", state=True)


def fill_heat(
    heats: Rows,
    section: ResolvedThermal,
    ambient_degC: ArrayLike,
    period_s: float | Array,
    winding_J_K: PerGroup,
    settled: Array,
) -> None:
    """Fill the heat of plants, which may be off; all is at the ambient temperature but the rotor.

    Parameters
    ----------
    heats : array of MagnetHeat
        In which all numbers are 0.
    section : ResolvedThermal
    ambient_degC : float or (n, 1) array, °C
    period_s : float or (n, 1) array, s
        Control period.
    winding_J_K : float or one for each group, J/K
        Heat capacity of the winding of a group.
    settled : (groups,) or (n, groups) array
        Share of a step of the power that the temperature of each winding reaches in a period.

    Raises
    ------
    InputError
        The windings exchange more heat with the stator in a period than it can store: the stator and the
        windings take their steps in turn.
    """
    if not np.any(section.on):
        return
    put(heats, on=section.on, winding_J_K=winding_J_K)
    _check_stator(heats, section.stator_heat_capacity_J_K, settled)
    matrix, capacity, outer = heats["matrix_W_K"], heats["capacity_W_K"], heats["to_ambient_W_K"]
    capacity[:, :1] = section.stator_heat_capacity_J_K / period_s
    capacity[:, 1:] = section.rotor_heat_capacity_J_K / period_s
    outer[:, :1], outer[:, 1:] = 1 / section.stator_to_ambient_K_W, 1 / section.rotor_to_ambient_K_W
    gap = 1 / section.air_gap_K_W
    matrix[:, [0, 1], [0, 1]], matrix[:, [0, 1], [1, 0]] = capacity + outer + gap, -gap
    put(
        heats,
        remanence_per_K=section.remanence_per_K,
        ambient_degC=ambient_degC,
        period_s=period_s,
        stator_degC=ambient_degC,
        last_degC=ambient_degC,
        rotor_degC=initial_degC(section, ambient_degC),
    )
    heats[heats["on"] == 0] = 0


def _check_stator(heats: Rows, stator_J_K: ArrayLike, settled: Array) -> None:
    exchanged_J_K = np.sum(settled * heats["winding_J_K"], axis=1)
    stator_J_K = np.broadcast_to(stator_J_K, (len(heats), 1))[:, 0]
    for row in np.flatnonzero((heats["on"] != 0) & ~(exchanged_J_K < stator_J_K)):
        raise InputError(
            "scenario: expected a plant.thermal.stator_heat_capacity_J_K above"
            f" {exchanged_J_K[row]:g} J/K, which the windings exchange with the stator in a control period,"
            f" received {stator_J_K[row]:g} J/K"
        )


def initial_degC(section: ThermalSection, ambient_degC: Any) -> Any:
    """Return the initial temperature of the rotor."""
    return ambient_degC if section.rotor_degC is None else section.rotor_degC


def remanence(section: ResolvedThermal, ambient_degC: float) -> float:
    """Return the initial remanence over that of the torque curve; 1 if no temperatures are computed."""
    rise = initial_degC(section, ambient_degC) - REFERENCE_degC
    return 1.0 + section.remanence_per_K * rise if section.on else 1.0


@inlined
def begin_heat(heat: MagnetHeat, gain: Array, coil: GroupCoils) -> None:
    """Multiply the gains (n,) by the present remanence; the stator is the surroundings of the coils."""
    factor = 1.0 + heat.remanence_per_K * (heat.rotor_degC - REFERENCE_degC)
    coil.surroundings_degC = heat.stator_degC
    for j in range(gain.shape[0]):
        gain[j] *= factor


@inlined
def advance_heat(heat: MagnetHeat, winding_degC: Array, copper_J: Array) -> None:
    """Advance the temperatures of stator and rotor by one control period, after those of the windings.

    The implicit Euler step is of first order; a period is some 1e-6 of a time constant. What the windings
    lose and do not store is released: energy is conserved to rounding.

    Parameters
    ----------
    heat : MagnetHeat
    winding_degC : (groups,) array, °C
        Present temperatures of the windings.
    copper_J : (groups,) array, J
        Losses of the windings in this period.
    """
    released_J = 0.0
    for j in range(copper_J.shape[0]):
        released_J += copper_J[j] - heat.winding_J_K[j] * (winding_degC[j] - heat.last_degC[j])
        heat.last_degC[j] = winding_degC[j]
    matrix, ambient = heat.matrix_W_K, heat.ambient_degC
    stator = heat.capacity_W_K[0] * heat.stator_degC + heat.to_ambient_W_K[0] * ambient
    stator += released_J / heat.period_s
    rotor = heat.capacity_W_K[1] * heat.rotor_degC + heat.to_ambient_W_K[1] * ambient
    determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    heat.stator_degC = (matrix[1, 1] * stator - matrix[0, 1] * rotor) / determinant
    heat.rotor_degC = (matrix[0, 0] * rotor - matrix[1, 0] * stator) / determinant


@inlined
def log_heat(heat: MagnetHeat, row: Array) -> None:
    """Write the temperatures of stator and rotor into the beginning of a row."""
    row[0], row[1] = heat.stator_degC, heat.rotor_degC


@inlined
def _begin(heat: MagnetHeat, plant: Any, substep: int) -> None:
    begin_heat(heat, plant.present_gain[:], plant.drive.coil)


@inlined
def _end(heat: MagnetHeat, plant: Any, substep: int) -> None:
    advance_heat(heat, plant.drive.coil.temperature_degC[:], plant.drive.flow.copper_J[:])


def _fill(rows: Rows, setup: PlantSetup) -> None:
    scenario, settled, section = setup.scenario, setup.drive["coil"]["settled"], setup.scenario.drive
    ambient_degC, period_s = section.ambient_degC, scenario.controller.period_s
    fill_heat(rows, scenario.plant.thermal, ambient_degC, period_s, section.heat_capacity_J_K, settled)


HEAT = PlantPart(MagnetHeat, _fill, begin=_begin, end=_end)
