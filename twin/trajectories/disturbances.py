"""Disturbances: torques on the hinges in addition to those of the coils."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.reuse import reused
from spheretwin.models.telemetry.csv_series import TIME, LONGEST_s, TimeSeries, check_rising, read

# The generator counts in blocks of four numbers; a tick uses the first number of its block.
NUMBERS_PER_COUNT = 4


class Draws(NamedTuple):
    """Uniform numbers from 0 to 1 at some control ticks, (n,) each."""

    paper: Callable[[], Array]
    """Numbers for the factor r of the paper."""
    of_term: Callable[[int], Array]
    """Numbers of a term, by its index among the terms."""


def term_draws(seed: int, first: int, ticks: int, place: int) -> Array:
    """Return the random numbers of one term at consecutive control ticks.

    Each seed and index has its own stream, whose numbers are indexed by tick: they are the same in any order
    and any block, and there is no state.

    Parameters
    ----------
    seed : int
        Seed of the run.
    first : int
        First tick.
    ticks : int
        Number of ticks.
    place : int
        Index of the term among the terms.

    Returns
    -------
    (ticks,) array
        Uniform numbers from 0 to 1.
    """
    counted = np.random.Philox(np.random.SeedSequence(seed, spawn_key=(place,))).advance(first)
    numbers = np.random.Generator(counted).random(NUMBERS_PER_COUNT * ticks)
    return numbers[::NUMBERS_PER_COUNT].copy()


CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

# Thousands of times the torque of the coils; larger values would only test the range of the engine.
LARGEST_Nm = 1000.0

Torque = Annotated[float, Field(ge=-LARGEST_Nm, le=LARGEST_Nm)]
Torques = tuple[Torque, Torque, Torque]
Time = Annotated[float, Field(ge=0, le=LONGEST_s)]

ZERO: Torques = (0.0, 0.0, 0.0)


class DisturbanceTerm(BaseModel):
    """Disturbance term of a scenario: parameters and torque."""

    model_config = CONFIG

    @abstractmethod
    def sample(self, t: NDArray[np.float64], draws: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the torque at control ticks, each held for a control period.

        Parameters
        ----------
        t : (n,) array, s
            Times of the ticks.
        draws : callable
            Returns the random numbers of the term at these ticks, (n,) from 0 to 1.

        Returns
        -------
        (n, 3) array, N·m
            Generalised torque on (α, β, γ), subtracted in (1).
        """


class ConstantDisturbance(DisturbanceTerm):
    """Constant torque."""

    kind: Literal["constant"] = Field("constant", description="kind of disturbance")
    torque_Nm: Torques = Field(ZERO, description="torque on each axis, N·m")

    def sample(self, t: NDArray[np.float64], draws: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the torque at some times, as `DisturbanceTerm.sample`."""
        return np.tile(self.torque_Nm, (len(t), 1))


Envelope = Literal["decaying", "growing"]
Bound = Annotated[float, Field(ge=0, le=LARGEST_Nm)]


class RandomDisturbance(DisturbanceTerm):
    """Uniform random factor per tick, equal on all axes, times ``cos πt``, ``-sin πt`` and ``exp ∓πt``."""

    kind: Literal["random"] = Field("random", description="kind of disturbance")
    bound_Nm: tuple[Bound, Bound, Bound] = Field(
        (0.05, 0.05, 0.05), description="bound of the random factor on each axis, N·m"
    )
    gamma_envelope: Envelope = Field(
        "decaying", description="exp(-πt) or, as printed, exp(πt) on the third axis"
    )

    def sample(self, t: Array, draws: Callable[[], Array]) -> Array:
        """Return the torque at some times, as `DisturbanceTerm.sample`."""
        return random_torque(t, draws(), np.array(self.bound_Nm), self.gamma_envelope)


def random_torque(t: Array, draws: Array, bound_Nm: Array, gamma_envelope: Envelope) -> Array:
    """Return the random torque (56) at control ticks.

    Parameters
    ----------
    t : (n,) array, s
        Times of the ticks.
    draws : (n,) array
        Uniform random numbers from 0 to 1.
    bound_Nm : (3,) array, N·m
        Bound of the random factor on each axis.
    gamma_envelope : "decaying" or "growing"
        Sign of the exponent on the third axis.

    Returns
    -------
    (n, 3) array, N·m
        Not finite if the growing envelope overflows.
    """
    r = -bound_Nm + 2 * bound_Nm * draws[:, None]  # (n, 3)
    factors = _factors(t, gamma_envelope if bound_Nm[2] else "none")
    with np.errstate(invalid="ignore"):  # infinity times a factor of 0
        return r * factors


@reused  # the rows of a study share their times
def _factors(t: Array, gamma_envelope: str) -> Array:
    growth = np.pi if gamma_envelope == "growing" else -np.pi
    with np.errstate(over="ignore"):
        third = np.zeros_like(t) if gamma_envelope == "none" else np.exp(growth * t)
    return np.stack([np.cos(np.pi * t), np.sin(-np.pi * t), third], axis=1)


# Far above the bandwidth of a control period.
LARGEST_Hz, LARGEST_rad = 1e6, 1e4

Frequency = Annotated[float, Field(ge=0, le=LARGEST_Hz)]
Phase = Annotated[float, Field(ge=-LARGEST_rad, le=LARGEST_rad)]


class SinusoidalDisturbance(DisturbanceTerm):
    """``amplitude sin(2 pi f t + phase)`` on each axis."""

    kind: Literal["sinusoidal"] = Field("sinusoidal", description="kind of disturbance")
    amplitude_Nm: Torques = Field(ZERO, description="amplitude on each axis, N·m")
    frequency_Hz: tuple[Frequency, Frequency, Frequency] = Field(
        (1.0, 1.0, 1.0), description="frequency on each axis, Hz"
    )
    phase_rad: tuple[Phase, Phase, Phase] = Field(
        (0.0, 0.0, 0.0), description="phase on each axis at 0 s, rad"
    )

    def sample(self, t: NDArray[np.float64], draws: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the torque at some times, as `DisturbanceTerm.sample`."""
        w = 2 * np.pi * np.array(self.frequency_Hz)
        swing: NDArray[np.float64] = np.sin(t[:, None] * w + np.array(self.phase_rad))
        return np.array(self.amplitude_Nm) * swing


class StepDisturbance(DisturbanceTerm):
    """Torques from stated times on; 0 before the first."""

    kind: Literal["steps"] = Field("steps", description="kind of disturbance")
    times_s: Annotated[tuple[Time, ...], Field(min_length=1)] = Field(
        (1.0,), description="times of the steps, rising, s"
    )
    torques_Nm: tuple[Torques, ...] = Field(
        (ZERO,), description="torque on each axis from each of these times on, N·m"
    )

    def sample(self, t: NDArray[np.float64], draws: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the torque at some times, as `DisturbanceTerm.sample`."""
        return TimeSeries(np.array(self.times_s), np.array(self.torques_Nm)).zero_order_hold(t, ZERO)

    @model_validator(mode="after")
    def _usable(self) -> StepDisturbance:
        if len(self.times_s) != len(self.torques_Nm):
            raise ValueError(
                f"expected as many torques_Nm as times_s, received {len(self.torques_Nm)}"
                f" for {len(self.times_s)} times"
            )
        check_rising(self.times_s)
        return self


COLUMNS = ("alpha_Nm", "beta_Nm", "gamma_Nm")


class TableDisturbance(DisturbanceTerm):
    """Torques of a CSV file at their times; the first before, the last after them.

    The file is read when the term is created; later changes of the file have no effect.

    Raises
    ------
    InputError
        The file is not a series of torques.
    """

    kind: Literal["table"] = Field("table", description="kind of disturbance")
    file: Annotated[str, Field(min_length=1)] = Field(
        description=f"CSV of the torques, with the columns {', '.join((TIME, *COLUMNS))}",
        json_schema_extra={"path": True},
    )
    between: Literal["linear", "held"] = Field(
        "linear", description="torque between two rows: linear interpolation, or the earlier row held"
    )

    _torques: TimeSeries = PrivateAttr()

    def sample(self, t: NDArray[np.float64], draws: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the torque at some times, as `DisturbanceTerm.sample`."""
        if self.between == "held":
            return self._torques.zero_order_hold(t, self._torques.values[0])
        return self._torques.interpolate(t)

    @model_validator(mode="after")
    def _read(self) -> TableDisturbance:
        self._torques = read("disturbance", Path(self.file), COLUMNS, LARGEST_Nm)
        return self


AnyDisturbance = Annotated[
    ConstantDisturbance  # one row each
    | StepDisturbance
    | SinusoidalDisturbance
    | TableDisturbance
    | RandomDisturbance,
    Field(discriminator="kind"),
]

KINDS: dict[str, type[DisturbanceTerm]] = {
    kind.model_fields["kind"].default: kind for kind in get_args(get_args(AnyDisturbance)[0])
}


LOAD_UNIT_Nm = 0.05  # paper: torque of L = 1 on each axis

# A hundred times the torque of the coils.
LARGEST_LOAD = 1000.0


class Disturbance(BaseModel):
    """Disturbance torque on the hinges."""

    model_config = CONFIG

    load: Annotated[float, Field(ge=-LARGEST_LOAD, le=LARGEST_LOAD)] = Field(
        0.0, description="L, constant load in units of 0.05 N·m on each axis"
    )
    random_bound_Nm: Bound = Field(0.0, description="bound of the uniform random factor r, N·m (paper: 0.05)")
    gamma_envelope: Envelope = Field(
        "decaying", description="exp(-πt) or, as printed, exp(πt) on the third axis"
    )
    terms: tuple[AnyDisturbance, ...] = Field(
        (), description="terms to be added: constant, steps, sinusoidal, table, random"
    )

    @property
    def is_random(self) -> bool:
        """True if the disturbance depends on the seed."""
        return self.random_bound_Nm > 0 or any(isinstance(term, RandomDisturbance) for term in self.terms)

    @property
    def grows(self) -> bool:
        """True if the disturbance may overflow in a long run."""
        terms = [term.gamma_envelope for term in self.terms if isinstance(term, RandomDisturbance)]
        return "growing" in (self.gamma_envelope if self.random_bound_Nm else "", *terms)

    def sample(self, t: NDArray[np.float64], draws: Draws) -> NDArray[np.float64]:
        """Return the disturbance at the control ticks, each held for a control period.

        Parameters
        ----------
        t : (n,) array, s
            Times of the ticks.
        draws : Draws
            Random numbers of these ticks.

        Returns
        -------
        (n, 3) array, N·m
            Generalised torque, subtracted in (1); not finite if a growing envelope overflows.
        """
        torque = np.full((len(t), 3), self.load * LOAD_UNIT_Nm)
        if self.random_bound_Nm:
            bound = np.full(3, self.random_bound_Nm)
            torque += random_torque(t, draws.paper(), bound, self.gamma_envelope)
        for place, term in enumerate(self.terms):
            torque += term.sample(t, partial(draws.of_term, place))
        return torque
