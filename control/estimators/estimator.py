"""Estimator of rates as the loop sees it: a function of fixed signature, its parameters and its memory.

Estimators are compared by two figures, which each derives in its own file and gives in `derived`:

- *noise gain*, 1/s: standard deviation of the rate over that of white noise on the angle;
- *lag*, s: steady-state delay of the estimate under a ramp of the rate. The error of the rate is lag times
  acceleration.

The *bandwidth* ω of an estimator is the frequency at which its gain from the true rate to the estimated one
has fallen by 3 dB. Every estimator has it as a parameter, for comparison. It does not determine which one is
fast enough: the phase loss in the loop counts, which differs with the order.

The defaults come from the loop: AFSM with the paper's gains at 1 kHz, angles with the prototype's noise
(0.02° rms on α and β, 0.18° a count on γ), one period of delay. Noise costs little except current; an
estimator that is too slow makes the sliding variable oscillate, which first shows in the largest errors. The
study `estimators` measures each over its bandwidth on the sinusoid and the nutation; `spheretwin reproduce
figure11` draws error and lag of the rates alone.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from spheretwin.control.law import each
from spheretwin.models.base.addresses import caller_of
from spheretwin.models.base.compiled import COMPILES, allocation_free, compiled_callback
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.telemetry.signals import ANGLES

_vector = types.float64[::1]

SIGNATURE = types.void(_vector, _vector, _vector, _vector)
"""Compiled signature: angle (3,), parameters, state, rate (3,)."""

LARGEST_ANGLE_rad = 1e100
"""Limit to which an angle is clipped: differences of larger ones would overflow."""

LEAST_JUMP_rad, FASTEST_ROTOR_rad_s = 0.2, 200.0
"""Between two samples no rotor turns further than both. A single wrong sample would otherwise give a rate
of thousands of rad/s."""

SLOWEST_rad_s, FASTEST_rad_s = 1e-3, 1e6  # a bandwidth beyond these is a mistake

Bandwidth = Annotated[float, Field(ge=SLOWEST_rad_s, le=FASTEST_rad_s)]
BandwidthEach = Annotated[tuple[Bandwidth, Bandwidth, Bandwidth], BeforeValidator(each)]

call_estimator = caller_of(SIGNATURE)


class Estimator(NamedTuple):
    """Estimator of rates, ready for the loop."""

    name: str
    """For tables and figures."""
    step: Callable[..., Any]
    """``step(angle, parameters, state, rate)``, called once a control tick with the measured angles, writes
    the estimated rates, rad/s. The first call starts at the first angle, with rate 0. An angle that is not
    finite gives a rate of NaN on that axis only, which then starts again; one that `jumped`
    leaves the rate as it was."""
    parameters: NDArray[np.float64]
    """(n,) passed to every call."""
    state: NDArray[np.float64]
    """(m,) memory, zeros before the first tick; each run works on its own copy."""


class Sampling(NamedTuple):
    """Nominal sampling of the angles."""

    period_s: float
    noise_rad: NDArray[np.float64]
    """(3,) standard deviation of each measured angle; 0 if unknown, or if there is no noise."""
    quantum_rad: NDArray[np.float64]
    """(3,) resolution of each measured angle; 0 if there is none."""

    def deviation_rad(self) -> NDArray[np.float64]:
        """Return noise and rounding together, (3,): a uniform error of one step has the variance step²/12."""
        return np.sqrt(self.noise_rad**2 + self.quantum_rad**2 / 12)


class Derived(NamedTuple):
    """Derived noise gain and lag of an estimator, for one tuning."""

    noise_gain_1_s: NDArray[np.float64]  # (3,)
    lag_s: NDArray[np.float64]  # (3,)


class EstimatorParameters(BaseModel):
    """Base class of the parameters of an estimator, each with its range and meaning."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    kind: str

    @abstractmethod
    def build(self, sampling: Sampling) -> Estimator | None:
        """Return an estimator with these parameters; None if the law receives the true rates."""

    @abstractmethod
    def derived(self, sampling: Sampling) -> Derived:
        """Return noise gain and lag."""


def named(kind: str) -> Any:
    """Return the field of an estimator's name."""
    return Field(kind, description="source of the rates that the law receives")


def bandwidth_field(default_rad_s: float) -> Any:
    """Return the field of the bandwidth, which every estimator except the ideal one has."""
    return Field(
        each(default_rad_s), description="frequency at which the gain of the rate has fallen by 3 dB, rad/s"
    )


def within_range(kind: str, name: str, values: NDArray[np.float64], low: float, high: float) -> None:
    """Check a derived tuning parameter.

    Raises
    ------
    InputError
        A value is not between `low` and `high`.
    """
    for axis, value in zip(ANGLES, values, strict=True):
        if not low <= value <= high:
            raise InputError(
                f"estimator {kind}: expected a {name} from {low:g} to {high:g} for {axis},"
                f" received parameters that lead to {shown(float(value))}"
            )


@allocation_free
def usable(angle: float) -> float:
    """Return an angle clipped to `LARGEST_ANGLE_rad`; NaN if it is not finite."""
    if not abs(angle) < np.inf:
        return np.nan
    return min(max(angle, -LARGEST_ANGLE_rad), LARGEST_ANGLE_rad)


@allocation_free
def jumped(change: float, period_s: float) -> bool:
    """Return True if an angle changed further in a period than a rotor turns."""
    return abs(change) > max(LEAST_JUMP_rad, FASTEST_ROTOR_rad_s * period_s)


def estimates(estimator: Estimator, angle_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rates that an estimator gives for a whole record.

    Parameters
    ----------
    estimator : Estimator
        Its memory is copied.
    angle_rad : (n, 3) array, rad
        One row per control tick; not changed, even by an estimator that filters angles.

    Returns
    -------
    (n, 3) array, rad/s
    """
    function = compiled_callback(SIGNATURE, estimator.step)
    rates, angle = np.empty(angle_rad.shape), np.empty(3)
    handed = function.address if COMPILES else function
    _follow(handed, angle_rad, estimator.parameters.copy(), estimator.state.copy(), angle, rates)
    return rates


@allocation_free
def _follow(
    step: Any,
    angles: NDArray[np.float64],
    parameters: NDArray[np.float64],
    state: NDArray[np.float64],
    angle: NDArray[np.float64],
    rates: NDArray[np.float64],
) -> None:
    for tick in range(len(angles)):
        for axis in range(3):
            angle[axis] = angles[tick, axis]
        call_estimator(step, angle, parameters, state, rates[tick])


class Ideal(EstimatorParameters):
    """Ideal estimator: the true rates."""

    kind: Literal["ideal"] = named("ideal")

    def build(self, sampling: Sampling) -> Estimator | None:
        """Return None: the law receives the true rates."""
        return None

    def derived(self, sampling: Sampling) -> Derived:
        """Return no noise gain and no lag."""
        return Derived(np.zeros(3), np.zeros(3))
