r"""A discrete linear system as a law: ``x' = A x + B e, torque = C x + D e``, once a control period.

The error is *reference minus measured*, as the sum in front of a controller in a textbook's loop has it, so
that a gain that stabilises is positive; the telemetry's `error_rad` has the other sign. Of one output, the
same system runs on each axis. It is told of no limit of the currents: an integrator in it winds up.

A system is known by what it has: matrices, polynomials, or a method that makes matrices of it. So neither
python-control nor scipy need be there for a law that is none of theirs.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin.models.base.errors import InputError, shown, without_breaks

Array = NDArray[np.float64]

MATRIX = 3  # layout of the parameters: the constant torque, then [A B; C D] by rows
KINDS = "a state space, or a proper transfer function, or zeros, poles and gain"
SAMPLE_FIRST = (
    "sample it first, as system.to_discrete(1e-3, 'bilinear') of scipy"
    " or control.sample_system(system, 1e-3, 'bilinear')"
)


class StateSpace(NamedTuple):
    """Matrices of a discrete system with n states, m inputs, p outputs."""

    A: Array  # (n, n)
    B: Array  # (n, m)
    C: Array  # (p, n)
    D: Array  # (p, m)


class Running(NamedTuple):
    """What a law is made of."""

    parameters: Array
    state: Array
    period_s: float


def running(
    law: str, system: Any, inertia_kg_m2: ArrayLike | None = None, constant_torque_Nm: ArrayLike = 0.0
) -> Running:
    """Numbers that `step` runs a system by, its state at 0.

    Parameters
    ----------
    law : str
        Name of the law, for complaints.
    system : discrete linear system
        Of python-control or scipy, or with their attributes.
    inertia_kg_m2 : float or (3,) array, kg·m², optional
        What the outputs are multiplied by, where they are accelerations.
    constant_torque_Nm : float or (3,) array, N·m
        Added to the outputs.

    Raises
    ------
    InputError
        The system is no discrete one, is improper, has other inputs and outputs than an error and a torque,
        or a number of it is not finite.
    """
    period_s = _period(law, system)
    matrices = _for_all_axes(law, _checked(law, _state_space(law, system)))
    factor = np.ones(3) if inertia_kg_m2 is None else _each(law, "inertia_kg_m2", inertia_kg_m2)
    constant = _each(law, "constant_torque_Nm", constant_torque_Nm)
    A, B, C, D = matrices
    joined = np.block([[A, B], [factor[:, None] * C, factor[:, None] * D]])
    return Running(np.concatenate([constant, joined.ravel()]), np.zeros(2 * len(A)), period_s)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick, as `control.law.Law` says.

    The second half of the state is where the next one is put together. Sizes follow from those of the arrays,
    never from numbers in them, which a scenario may set: what fits no system gives no torque.
    """
    states = state.shape[0] // 2
    width = (parameters.shape[0] - MATRIX) // (states + 3)
    rows = (width - states) // 3
    if rows < 1 or rows > 2:
        return
    for i in range(states + 3):
        first, total = MATRIX + i * width, 0.0
        for j in range(states):
            total += parameters[first + j] * state[j]
        for row in range(rows):
            for axis in range(3):
                error = reference[row, axis] - measurement[row, axis]
                total += parameters[first + states + 3 * row + axis] * error
        if i < states:
            state[states + i] = total
        else:
            torque[i - states] = parameters[i - states] + total
    for i in range(states):
        state[i] = state[states + i]


def _period(law: str, system: Any) -> float:
    """Sampling time of a system, s."""
    dt: Any = getattr(system, "dt", None)
    is_number = isinstance(dt, int | float | np.integer | np.floating) and not isinstance(dt, bool)
    if not is_number or not 0 < dt < np.inf:  # None marks a continuous one of scipy, 0 one of python-control
        raise InputError(
            f"law {law}: expected a discrete system with its dt in s, received one with dt {shown(dt)};"
            f" {SAMPLE_FIRST}"
        )
    return float(dt)


def _state_space(law: str, system: Any) -> tuple[Any, ...]:
    """Matrices of a system, as it has them or as its polynomials give them."""
    try:
        if hasattr(system, "A"):
            return system.A, system.B, system.C, system.D
        if hasattr(system, "num"):
            return _realised(law, *_polynomials(system))
        if hasattr(system, "to_ss"):
            made = system.to_ss()
            return made.A, made.B, made.C, made.D
    except InputError:
        raise
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(f"law {law}: expected {KINDS}, {without_breaks(error)}") from None
    raise InputError(f"law {law}: expected {KINDS}, received {shown(system)}")


def _polynomials(system: Any) -> tuple[Any, Any]:
    """Numerators and denominators by output and input; coefficients of falling powers of z."""
    if isinstance(system.num, np.ndarray):  # of scipy: one input, and one denominator for all outputs
        rows = np.atleast_2d(system.num)
        return [[row] for row in rows], [[system.den] for _ in rows]
    return getattr(system, "num_list", system.num), getattr(system, "den_list", system.den)


def _realised(law: str, numerators: Any, denominators: Any) -> StateSpace:
    """Controllable canonical form of every entry, side by side: as many states as all entries have."""
    outputs, inputs = len(numerators), len(numerators[0])
    entries = [
        (i, j, _canonical(law, numerators[i][j], denominators[i][j]))
        for i in range(outputs)
        for j in range(inputs)
    ]
    states = sum(len(each.A) for _, _, each in entries)
    A, B = np.zeros((states, states)), np.zeros((states, inputs))
    C, D = np.zeros((outputs, states)), np.zeros((outputs, inputs))
    first = 0
    for i, j, each in entries:
        own = slice(first, first + len(each.A))
        A[own, own], B[own, j], C[i, own], D[i, j] = each.A, each.B[:, 0], each.C[0], each.D[0, 0]
        first = own.stop
    return StateSpace(A, B, C, D)


def _canonical(law: str, numerator: Any, denominator: Any) -> StateSpace:
    b, a = (np.trim_zeros(_real(law, "a transfer function", each), "f") for each in (numerator, denominator))
    if len(b) > len(a) or not len(a):
        raise InputError(
            f"law {law}: expected {KINDS}, received a numerator of {len(b)} coefficients"
            f" over a denominator of {len(a)}"
        )
    order = len(a) - 1
    b, a = np.concatenate([np.zeros(len(a) - len(b)), b]) / a[0], a / a[0]
    A = np.eye(order, k=-1)
    A[:1] = -a[1:]
    return StateSpace(A, np.eye(order, 1), (b[1:] - b[0] * a[1:])[None], b[:1, None])


def _checked(law: str, matrices: tuple[Any, ...]) -> StateSpace:
    """Matrices of finite real numbers whose sizes fit each other."""
    A, B, C, D = (np.atleast_2d(_real(law, name, each)) for name, each in zip("ABCD", matrices, strict=True))
    n, (p, m) = len(A) if A.size else 0, D.shape
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n)}
    for (name, shape), each in zip(shapes.items(), (A, B, C), strict=True):
        if each.shape != shape and (each.size or n):
            raise InputError(f"law {law}: expected {name} of shape {shape}, received {each.shape}")
    return StateSpace(A.reshape(n, n), B.reshape(n, m), C.reshape(p, n), D)


def _for_all_axes(law: str, single: StateSpace) -> StateSpace:
    """Matrices from the errors of all axes to the torque on all."""
    outputs, inputs = single.D.shape
    if outputs == 3 and inputs in (3, 6):
        return single
    if outputs != 1 or inputs not in (1, 2):
        raise InputError(
            f"law {law}: expected 3 outputs of 3 or 6 inputs (the errors of the angles, then of the rates),"
            f" or 1 output of 1 or 2 for every axis, received {outputs} of {inputs}"
        )
    # Inputs come by row of the reference, then by axis, as `step` takes them.
    B = np.concatenate([_thrice(single.B[:, [row]]) for row in range(inputs)], axis=1)
    D = np.concatenate([_thrice(single.D[:, [row]]) for row in range(inputs)], axis=1)
    return StateSpace(_thrice(single.A), B, _thrice(single.C), D)


def _thrice(block: Array) -> Array:
    return np.asarray(np.kron(np.eye(3), block), np.float64)


def _each(law: str, name: str, given: ArrayLike) -> Array:
    numbers = _real(law, name, given)
    if numbers.shape not in ((), (3,)):
        raise InputError(f"law {law}: expected {name} as one number or three, received shape {numbers.shape}")
    return np.broadcast_to(numbers, 3)


def _real(law: str, name: str, given: Any) -> Array:
    try:
        found = np.asarray(given)
    except ValueError:  # rows of different lengths
        raise InputError(f"law {law}: expected {name} as an array, received {shown(given)}") from None
    if found.dtype.kind not in "biuf" or not np.all(np.isfinite(found)):
        raise InputError(f"law {law}: expected finite real numbers in {name}, received {shown(given)}")
    return found.astype(np.float64)
