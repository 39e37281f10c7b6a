"""Currents of the coil groups: with a supply by resistance, inductance and back-EMF, otherwise by a lag.

A group obeys ``L di/dt = v - R i - e`` with the voltage v at its ends. The turning rotor induces
``e = G_t^T w``: the electrical power e i equals the power of the torque ``G_t i`` at the rate w, to the last
digit. Copper loss heats a group, which loses heat to its surroundings: one heat capacity, one thermal
resistance. Each group has its own values.
"""

from __future__ import annotations

from math import expm1, factorial, inf
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.control.applied_torque import fill_lag_step
from spheretwin.models.base.arrays import Array, Integers
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.coil_group import PerGroup

# Terms -(-x)**n / (n + 1)! and (-x)**n (2**n - 2) / (n + 1)!, without (-x)**n and with the sign of the first;
# up to x = 1/4, the omitted terms are beyond the last digit.
_TERMS = 14
_MEAN = np.array([1 / factorial(n + 1) for n in range(_TERMS + 1)])
_SQUARE = np.array([(2**n - 2) / factorial(n + 1) for n in range(_TERMS + 1)])

# Below this limit the series need few terms; above it, differences lose only their last digits.
SERIES_TO = 0.25


class Relaxation(NamedTuple):
    """Shares of the start value (a) and of the final value (b), for a time x in time constants."""

    settled: float
    """``1 - exp(-x)``: share of the way at the end."""
    mean: float
    """Mean of ``1 - exp(-s)``: mean share of the way."""
    start_start: float
    """Mean of ``exp(-s)**2``."""
    start_settled: float
    """Mean of ``exp(-s) (1 - exp(-s))``."""
    settled_settled: float
    """Mean of ``(1 - exp(-s))**2``."""


@inlined
def relaxation(x: float) -> Relaxation:
    """Return the shares for a time of x time constants, x >= 0."""
    if x < SERIES_TO:
        mean, settled_settled = _series(x)
        remaining = 1.0 - mean  # on average
        settled = x * remaining
    else:
        settled = -expm1(-x)
        remaining = settled / x
        mean = (x - settled) / x
        settled_settled = (x - settled - 0.5 * settled * settled) / x
    return Relaxation(
        settled,
        mean,
        0.5 * remaining * (2.0 - settled),
        0.5 * remaining * settled,
        settled_settled,
    )


def relaxations(x: ArrayLike) -> Array:
    """Return the shares (n, 5) for n times."""
    return np.array([relaxation(time) for time in np.ravel(x).tolist()])


@inlined
def _series(x: float) -> tuple[float, float]:
    """Return ``1 - (1 - exp(-x)) / x`` and the mean of ``(1 - exp(-s))**2``, for small x."""
    mean, settled_settled = 0.0, 0.0
    for n in range(_TERMS, 0, -1):
        mean = _MEAN[n] - x * mean
        settled_settled = _SQUARE[n] - x * settled_settled
    return x * mean, -x * settled_settled


DRIVEN, OPEN, SHORTED = 0, 1, 2
"""Connection of a group."""

# Temperature of the stated resistances.
REFERENCE_degC = 20.0


Resistance = Annotated[float, Field(ge=1e-3, le=1e6)]
Inductance = Annotated[float, Field(ge=1e-9, le=1e3)]
PerKelvin = Annotated[float, Field(ge=0, le=0.01)]
HeatCapacity = Annotated[float, Field(ge=1e-3, le=1e6)]
ThermalResistance = Annotated[float, Field(ge=0, le=1e6)]
Shutdown = Annotated[float, Field(ge=-60, le=1e4)]


class CoilSection(BaseModel):
    """Electrical and thermal parameters of a group."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    resistance_ohm: Resistance | tuple[Resistance, ...] | None = Field(
        None,
        description="resistance of a group at 20 °C, one number or one for each, ohm; the model file's unless"
        " given (assumed: 1.3)",
    )
    inductance_H: Inductance | tuple[Inductance, ...] | None = Field(
        None,
        description="inductance of a group, one number or one for each, H; the model file's unless given"
        " (assumed: 0.9e-3)",
    )
    coil_coupling: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0,
        description="share of the mutual inductance of the groups, which is computed from the model's coils;"
        " 0 for none, 1 for all; needs supply_V",
    )
    resistance_per_K: PerKelvin | tuple[PerKelvin, ...] | None = Field(
        None,
        description="relative rise of the resistance, one number or one for each group, 1/K, from 20 °C; the"
        " model file's unless given (property of copper: 0.0039)",
    )
    heat_capacity_J_K: HeatCapacity | tuple[HeatCapacity, ...] | None = Field(
        None,
        description="heat capacity of a group, one number or one for each, J/K; the model file's unless given"
        " (assumed: 60)",
    )
    thermal_resistance_K_W: ThermalResistance | tuple[ThermalResistance, ...] | None = Field(
        None,
        description="thermal resistance from a group to its surroundings, one number or one for each, K/W;"
        " the model file's unless given (assumed: 4)",
    )
    ambient_degC: Annotated[float, Field(ge=-60, le=300)] = Field(
        20.0, description="ambient temperature, and initial temperature of the coils, °C (assumed)"
    )
    shutdown_degC: Shutdown | tuple[Shutdown, ...] | None = Field(
        None,
        description="temperature of a group from which its amplifier is shut down, one number or one for"
        " each, °C; the temperature limit of the model file unless given (assumed: 155, insulation of class"
        " F)",
    )


class GroupCoils(Record):
    """Coils of all groups."""

    inductance_H: Array = field("inductance", "H", "groups")
    cold_resistance_ohm: Array = field("resistance at `REFERENCE_degC`", "ohm", "groups")
    resistance_per_K: Array = field("relative rise of the resistance", "1/K", "groups")
    thermal_resistance_K_W: Array = field("from a group to its surroundings", "K/W", "groups")
    shutdown_degC: Array = field("temperature of a shutdown; infinite if there is none", "°C", "groups")
    settled: Array = field("share of the way to the final temperature in a control period", "", "groups")
    period_s: float = field("control period", "s")
    temperature_degC: Array = field("present temperature", "°C", "groups", state=True)
    resistance_ohm: Array = field("resistance at that temperature", "ohm", "groups", state=True)
    surroundings_degC: float = field("ambient temperature, or that of a stator", "°C")
    contact: Integers = field("`DRIVEN`, `OPEN` or `SHORTED`", "", "groups", fault=True)


def fill_coils(rows: Rows, section: Any, period_s: float) -> None:
    """Fill the coils, at ambient temperature.

    Parameters
    ----------
    rows : array of GroupCoils
    section : CoilSection
        With every value given, except that of no shutdown.
    period_s : float, s
        Control period, in which the temperature advances once.
    """
    time_constants_s = np.multiply(section.thermal_resistance_K_W, section.heat_capacity_J_K)
    pairs = np.broadcast(period_s, time_constants_s)
    settled = [relaxation(period / time).settled if time > 0 else 1.0 for period, time in pairs]
    put(rows, settled=np.reshape(settled, pairs.shape), period_s=period_s)
    put(rows, inductance_H=section.inductance_H, thermal_resistance_K_W=section.thermal_resistance_K_W)
    put(rows, shutdown_degC=inf if section.shutdown_degC is None else section.shutdown_degC)
    put(rows, temperature_degC=section.ambient_degC, surroundings_degC=section.ambient_degC)
    put(rows, cold_resistance_ohm=section.resistance_ohm, resistance_per_K=section.resistance_per_K)
    warm = 1.0 + rows["resistance_per_K"] * (section.ambient_degC - REFERENCE_degC)
    rows["resistance_ohm"] = rows["cold_resistance_ohm"] * warm


@inlined
def update_resistance(coil: GroupCoils) -> None:
    """Update the resistances: ``R = R20 (1 + a (T - 20 °C))`` at the present temperatures."""
    for j in range(coil.resistance_ohm.shape[0]):
        rise = coil.temperature_degC[j] - REFERENCE_degC
        coil.resistance_ohm[j] = coil.cold_resistance_ohm[j] * (1.0 + coil.resistance_per_K[j] * rise)


@inlined
def advance_temperature(coil: GroupCoils, copper_J: Array) -> None:
    """Advance temperature and resistance by one control period, exactly for the mean power in it.

    Parameters
    ----------
    coil : GroupCoils
        Changed in place.
    copper_J : (n,) array, J
        Copper loss of each group in the period.
    """
    for j in range(copper_J.shape[0]):
        power = copper_J[j] / coil.period_s
        last = coil.surroundings_degC + coil.thermal_resistance_K_W[j] * power
        coil.temperature_degC[j] += (last - coil.temperature_degC[j]) * coil.settled[j]
    update_resistance(coil)


@inlined
def is_overheated(coil: GroupCoils) -> bool:
    """True if the temperature of a group has reached the shutdown limit or is not a number."""
    for j in range(coil.temperature_degC.shape[0]):
        if not coil.temperature_degC[j] < coil.shutdown_degC[j]:
            return True
    return False


@inlined
def back_emf(
    torque_matrix: Array,
    gain: Array,
    rate_S: Array,
    emf: Array,
) -> None:
    """Compute the back-EMF ``e = G_t^T w`` with the true torque matrix.

    Parameters
    ----------
    torque_matrix : (3, n) array, N·m/A
        Torque on the rotor per ampere of each group, in the frame of the stator (15); equal to V·s.
    gain : (n,) array
        Torque per ampere of each group over that of the matrix.
    rate_S : (3,) array, rad/s
        Angular velocity of the rotor, in the stator's frame.
    emf : (n,) array, V
        Result, opposed to the current.
    """
    x, y, z = rate_S[0], rate_S[1], rate_S[2]
    for j in range(emf.shape[0]):
        emf[j] = gain[j] * (torque_matrix[0, j] * x + torque_matrix[1, j] * y + torque_matrix[2, j] * z)


class CurrentLag(Record):
    """First-order lag, solved exactly over one physics step with the command held."""

    decay: Array = field("share of the distance to the command that remains after a step", "", "groups")
    mean_share: Array = field("share of it that remains on average over the step", "", "groups")
    current_limit_A: float = field("limit of the amplifiers, for any command", "A")


def fill_lag(rows: Rows, time_constant_s: PerGroup, step_s: float, current_limit_A: float) -> None:
    """Fill the lag for time constants L/R (s; 0: ideal amplifiers), a physics step (s) and a limit (A)."""
    fill_lag_step(rows, step_s, time_constant_s)
    put(rows, current_limit_A=current_limit_A)


@inlined
def advance_lag(
    lag: CurrentLag,
    command: Array,
    current: Array,
    mean: Array,
) -> None:
    """Advance the currents by one physics step.

    Parameters
    ----------
    lag : CurrentLag
        Lag of the groups.
    command : (n,) array, A
        Held over the step; the amplifiers follow it up to their limit.
    current : (n,) array, A
        At the start of the step; on return, at its end.
    mean : (n,) array, A
        Result: mean over the step, which acts on the rotor.
    """
    limit = lag.current_limit_A
    for j in range(command.shape[0]):
        target = min(max(command[j], -limit), limit)
        distance = current[j] - target
        mean[j] = target + lag.mean_share[j] * distance
        current[j] = target + lag.decay[j] * distance
