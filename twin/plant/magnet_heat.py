"""Temperatures of stator and rotor, and the remanence of the magnets at the rotor's temperature.

The windings release heat to the stator, the stator to its surroundings and through the air gap to the rotor,
the rotor to its surroundings through shaft and air. Stator and rotor have one temperature each:

    C_s dT_s/dt = P - (T_s - T_r) / R_g - (T_s - T_0) / R_s
    C_r dT_r/dt = (T_s - T_r) / R_g - (T_r - T_0) / R_r

Torque and back-EMF fall with the remanence, ``1 + a (T_r - 20 °C)``. Losses in the magnets and in the
bearings are neglected: eddy currents are below 1 mW at 1 rad/s, friction is below 10 mW.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.electronics.coil import REFERENCE_degC
from spheretwin.electronics.drive_chain import DriveChain
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.errors import InputError
from spheretwin.models.coil_group import PerGroup, of_each_group

Array = NDArray[np.float64]
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


class MagnetHeat(NamedTuple):
    """Heat of stator and rotor with its state, for compiled code."""

    remanence_per_K: float
    ambient_degC: float
    winding_J_K: Array  # (n,) heat capacity of the winding of each group
    period_s: float
    matrix_W_K: Array  # (2, 2) C / h + conductances, of stator and rotor
    capacity_W_K: Array  # (2,) C / h
    to_ambient_W_K: Array  # (2,)
    stator_degC: Array  # (1,) state: surroundings of the windings
    rotor_degC: Array  # (1,) state
    last_degC: Array  # (n,) state: windings at the end of the last period
    winding_degC: Array  # (n,) of the drive
    copper_J: Array  # (n,) of the drive: loss in this period

    def state_arrays(self) -> tuple[Array, ...]:
        """Return the arrays with the state."""
        return self.stator_degC, self.rotor_degC, self.last_degC


def magnet_heat(
    section: ResolvedThermal, drive: DriveChain, ambient_degC: float, winding_J_K: PerGroup
) -> MagnetHeat:
    """Return the heat of a plant; the stator becomes the surroundings of the drive's windings.

    Parameters
    ----------
    section : ResolvedThermal
    drive : DriveChain
        With a supply; at rest.
    ambient_degC : float, °C
    winding_J_K : float or one for each group, J/K
        Heat capacity of the winding of a group.

    Raises
    ------
    InputError
        The windings exchange more heat with the stator in a period than it can store: the stator and the
        windings take their steps in turn.
    """
    period_s, coil = drive.coil.period_s, drive.coil
    windings_J_K = of_each_group(winding_J_K, len(coil.settled))
    exchanged_J_K = float(np.sum(coil.settled * windings_J_K))
    if not exchanged_J_K < section.stator_heat_capacity_J_K:
        raise InputError(
            f"scenario: expected a plant.thermal.stator_heat_capacity_J_K above {exchanged_J_K:g} J/K, which"
            " the windings exchange with the stator in a control period,"
            f" received {section.stator_heat_capacity_J_K:g} J/K"
        )
    capacity = np.array([section.stator_heat_capacity_J_K, section.rotor_heat_capacity_J_K]) / period_s
    outer = 1 / np.array([section.stator_to_ambient_K_W, section.rotor_to_ambient_K_W])
    gap = 1 / section.air_gap_K_W
    return MagnetHeat(
        remanence_per_K=section.remanence_per_K,
        ambient_degC=ambient_degC,
        winding_J_K=windings_J_K,
        period_s=period_s,
        matrix_W_K=np.diag(capacity + outer + gap) + gap * np.array([[0.0, -1.0], [-1.0, 0.0]]),
        capacity_W_K=capacity,
        to_ambient_W_K=outer,
        stator_degC=coil.surroundings_degC,
        rotor_degC=np.array([initial_degC(section, ambient_degC)]),
        last_degC=coil.temperature_degC.copy(),
        winding_degC=coil.temperature_degC,
        copper_J=drive.flow.copper_J,
    )


def initial_degC(section: ThermalSection, ambient_degC: float) -> float:
    """Return the initial temperature of the rotor."""
    return ambient_degC if section.rotor_degC is None else section.rotor_degC


def remanence(section: ResolvedThermal, ambient_degC: float) -> float:
    """Return the initial remanence over that of the torque curve; 1 if no temperatures are computed."""
    rise = initial_degC(section, ambient_degC) - REFERENCE_degC
    return 1.0 + section.remanence_per_K * rise if section.on else 1.0


@inlined
def update_gain(heat: MagnetHeat | None, group_gain: Array, present: Array) -> None:
    """Compute the gains (n,) of the groups with the present remanence; without heat both are one array."""
    if heat is None:
        return
    factor = 1.0 + heat.remanence_per_K * (heat.rotor_degC[0] - REFERENCE_degC)
    for j in range(group_gain.shape[0]):
        present[j] = factor * group_gain[j]


@inlined
def advance_heat(heat: MagnetHeat | None) -> None:
    """Advance the temperatures of stator and rotor by one control period, after those of the windings.

    The implicit Euler step is of first order; a period is some 1e-6 of a time constant. What the windings
    lose and do not store is released: energy is conserved to rounding.
    """
    if heat is None:
        return
    released_J = 0.0
    for j in range(heat.copper_J.shape[0]):
        released_J += heat.copper_J[j] - heat.winding_J_K[j] * (heat.winding_degC[j] - heat.last_degC[j])
        heat.last_degC[j] = heat.winding_degC[j]
    matrix, ambient = heat.matrix_W_K, heat.ambient_degC
    stator = heat.capacity_W_K[0] * heat.stator_degC[0] + heat.to_ambient_W_K[0] * ambient
    stator += released_J / heat.period_s
    rotor = heat.capacity_W_K[1] * heat.rotor_degC[0] + heat.to_ambient_W_K[1] * ambient
    determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    heat.stator_degC[0] = (matrix[1, 1] * stator - matrix[0, 1] * rotor) / determinant
    heat.rotor_degC[0] = (matrix[0, 0] * rotor - matrix[1, 0] * stator) / determinant


@inlined
def log_heat(heat: MagnetHeat | None, row: Array) -> None:
    """Write the temperatures of stator and rotor into the beginning of a row."""
    if heat is not None:
        row[0], row[1] = heat.stator_degC[0], heat.rotor_degC[0]
