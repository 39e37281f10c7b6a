"""Control law as the loop sees it: a function of fixed signature, its parameters and its state."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from copy import deepcopy
from dataclasses import dataclass, replace
from types import FunctionType
from typing import Annotated, Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, Field

from spheretwin.control import lti
from spheretwin.models.base.arrays import real_array
from spheretwin.models.base.errors import InputError, distinct_texts, is_plain, shown
from spheretwin.models.telemetry.signals import COMMON_NAMES, Signal, width

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]

SIGNATURE = types.void(types.float64, _matrix, _matrix, _vector, _vector, _vector)
"""Compiled signature: t, reference (3, 3), measurement (3, 3), parameters, state, torque (3,)."""

# Periods are decimal fractions; equal periods are equal to rounding only.
SAME_PERIOD = 1e-9


class NominalModel(NamedTuple):
    """Nominal model that a law is built for; it holds nothing of the plant.

    Compiled functions of the equations of motion, for use inside a law: `inertia_matrix`, `coriolis_matrix`
    and `gravity_torque` of `models.lagrangian`, `rate_jacobian` and `cartesian_torque` of
    `models.kinematics`.
    """

    period_s: float
    """Control period."""
    delay_s: float
    """Nominal delay from a measurement to the currents that respond to it."""
    inertia: NDArray[np.float64]
    """Principal inertias, (3,) in kg·m²."""
    ahead_s: float = 0.0
    """Time from the measurement to the motion that the law receives, if the prediction is on; otherwise 0."""


@dataclass(frozen=True, eq=False)
class Law:
    """Control law, ready for the loop.

    Attributes
    ----------
    name : str
        For tables and figures.
    step : callable
        ``step(t, reference, measurement, parameters, state, torque)`` writes the generalised torque
        (N·m) on (alpha, beta, gamma) into `torque` and returns nothing. `reference` holds the desired
        angle, rate and acceleration as rows (rad, rad/s, rad/s²), `measurement` angle, rate, and the
        applied torque (N·m, generalised) of the coils over the last period, as the controller estimates
        it. If the prediction is on, three more rows hold the measured values; see
        `control.compensators.prediction`.
        `state` is the law's memory, changed in place. A plain Python function works; one that numba
        compiles runs at the speed of the shipped laws. It must write all three torques at every call:
        a missing or non-finite torque ends the run as ``diverged``. So does an exception, whose rows
        before it remain; `Session.law_error` and `Run.law_error` hold it as a `LawError`. A step in plain
        Python that returns a value, or writes no torque, raises a `LawError`, too.
        Compiled code is not checked for reads and writes outside the arrays: they corrupt other memory of
        the process or end it. With ``controller.check_bounds`` they are exceptions.
    parameters : (n,) array
        Numbers passed to every call; copied.
    state : (m,) array
        Memory at the start of a run; copied. Each run works on its own copy.
    signals : tuple of Signal
        Signals of the leading entries of the state, which the loop logs after every call.
    asks_torque : bool
        True if the law uses the third row of `measurement`, the applied torque. Otherwise the row is not
        computed and holds NaN. It is 0 at the first tick under the law.
    period_s : float, optional
        Control period that the law is designed for, s; any other is refused. Without it, any period is valid.
    current_limit_A : float
        Largest group current that the controller commands under the law, A, if it is less than that of the
        data sheet: the allocation scales the torque of law and feed-forward.
    cartesian : bool
        True if the step writes the Cartesian torque in the stator frame (N·m) instead of the generalised
        one. The controller allocates it as it is: nothing divides by cos β. The applied torque of
        `measurement` is generalised also then.

    Raises
    ------
    InputError
        The name is not a text or has control characters, the step is not a function, the numbers are not
        real, finite and one-dimensional, the signals do not fit the state, or the period or the limit is
        invalid.
    """

    name: str
    step: Callable[..., Any]
    parameters: NDArray[np.float64]
    state: NDArray[np.float64]
    signals: tuple[Signal, ...] = ()
    asks_torque: bool = False
    period_s: float | None = None
    current_limit_A: float = np.inf
    cartesian: bool = False

    @classmethod
    def from_lti(
        cls,
        system: Any,
        *,
        name: str = "lti",
        inertia_kg_m2: ArrayLike | None = None,
        constant_torque_Nm: ArrayLike = 0.0,
    ) -> Law:
        """Return a law that runs a discrete linear system, from errors to torques.

        Parameters
        ----------
        system : discrete linear system
            A state space or transfer function of python-control or scipy, or zeros, poles and gain, with its
            `dt` in s: the control period. Its three inputs are the errors of the angles (rad), *reference
            minus measured*; of six, the last three are those of the rates (rad/s). Its three outputs are the
            generalised torque (N·m). A system of one output, with one input or two, runs on each axis.
        name : str
            For tables and figures.
        inertia_kg_m2 : float or (3,) array, kg·m², optional
            If given, such as `NominalModel.inertia`, the outputs are accelerations (rad/s²) and are
            multiplied by it.
        constant_torque_Nm : float or (3,) array, N·m
            Added to the outputs: torque that holds the rotor at zero error.

        Raises
        ------
        InputError
            The system is continuous or improper, has another number of inputs or outputs, or holds a number
            that is not finite.
        """
        numbers = lti.lti_law(name, system, inertia_kg_m2, constant_torque_Nm)
        return cls(name, lti.step, numbers.parameters, numbers.state, period_s=numbers.period_s)

    def __repr__(self) -> str:
        return f"Law({self.name}: {self.parameters.size} parameters, {self.state.size} state numbers)"

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name or not is_plain(self.name):
            raise InputError(f"law: expected a name without control characters, received {shown(self.name)}")
        if not callable(self.step):
            raise InputError(f"law {self.name}: expected step as a function, received {shown(self.step)}")
        for field in ("parameters", "state"):
            object.__setattr__(self, field, _numbers(self.name, field, getattr(self, field)))
        for field in ("asks_torque", "cartesian"):
            if not isinstance(value := getattr(self, field), bool):
                raise InputError(
                    f"law {self.name}: expected {field} as True or False, received {shown(value)}"
                )
        object.__setattr__(self, "signals", _signals(self.name, self.signals))
        if width(self.signals) > len(self.state):
            raise InputError(
                f"law {self.name}: expected signals of at most {len(self.state)} numbers, the size of its"
                f" state, received {shown(width(self.signals))}"
            )
        names = Counter([*COMMON_NAMES, *(signal.name for signal in self.signals)])
        if twice := sorted(name for name, count in names.items() if count > 1):
            raise InputError(f"law {self.name}: expected new names of signals, received {', '.join(twice)}")
        period_s, limit_A = self.period_s, self.current_limit_A
        if period_s is not None and not (isinstance(period_s, int | float) and 0 < period_s < np.inf):
            raise InputError(
                f"law {self.name}: expected period_s as a number above 0, received {shown(period_s)}"
            )
        if not (isinstance(limit_A, int | float) and limit_A > 0):
            raise InputError(
                f"law {self.name}: expected current_limit_A as a number above 0, received {shown(limit_A)}"
            )

    def for_a_run(self) -> Law:
        """Return the law with a memory of its own: an object whose method or call is the step is copied.

        Compiled code has no memory but `state`. What a function encloses, global variables, and objects that
        cannot be copied, such as one with a socket, are shared between runs of one `Law`: keep memory in
        `state`, or name the law by its file, which is run again for each run.
        """
        try:
            step = _independent(self.step)
        except Exception:  # a copy runs code of the user, which may raise anything: the object is shared then
            return self
        return self if step is self.step else replace(self, step=step)

    def check_period(self, period_s: float) -> None:
        """Check a control period (s) against the one that the law is designed for.

        Raises
        ------
        InputError
            The law is designed for another period.
        """
        if self.period_s is not None and abs(period_s - self.period_s) > SAME_PERIOD * self.period_s:
            own, received = distinct_texts(self.period_s, period_s)
            raise InputError(f"law {self.name}: expected a control period of {own} s, received {received} s")


def _independent(step: Callable[..., Any]) -> Callable[..., Any]:
    """Return a step that shares no object with another run; the same if it holds none."""
    if hasattr(step, "py_func"):  # compiled: its closure is constant
        return step
    if isinstance(
        step, FunctionType
    ):  # what it encloses belongs to the caller, such as a list of its own rows
        return step
    return deepcopy(step)


def _numbers(law: str, field: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return a copy of an array in the layout that compiled code takes."""
    array = real_array(value)
    if array is None:
        raise InputError(f"law {law}: expected {field} as real numbers, received {shown(value)}")
    if array.ndim != 1:
        raise InputError(
            f"law {law}: expected {field} as a one-dimensional array, received shape {array.shape}"
        )
    numbers, is_finite = np.array(array, order="C"), np.isfinite(array)
    if not is_finite.all():
        entry = int(is_finite.argmin())
        raise InputError(
            f"law {law}: expected finite numbers in {field}, received {numbers[entry]} as entry {entry}"
        )
    return numbers


def _signals(law: str, values: Iterable[Signal]) -> tuple[Signal, ...]:
    signals = tuple(values) if isinstance(values, Iterable) else (values,)
    for signal in signals:
        if not isinstance(signal, Signal):
            raise InputError(f"law {law}: expected signals of type Signal, received {shown(signal)}")
    return signals


# Gains and times beyond this are mistakes; their products would overflow.
LARGEST = 1e9

NonNegative = Annotated[float, Field(ge=0, le=LARGEST)]
Positive = Annotated[float, Field(gt=0, le=LARGEST)]


def each(value: Any) -> Any:
    """Return a number for each of (alpha, beta, gamma); a single number is repeated."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return (value,) * 3
    return tuple(value) if isinstance(value, list) else value


NonNegativeEach = Annotated[tuple[NonNegative, NonNegative, NonNegative], BeforeValidator(each)]
PositiveEach = Annotated[tuple[Positive, Positive, Positive], BeforeValidator(each)]
