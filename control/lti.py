r"""Law that runs a discrete linear system: ``x' = A x + B e, torque = C x + D e``, once per control period.

The error is *reference minus measured*, as at the summing point of a textbook loop, so
that a stabilising gain is positive; `error_rad` of the telemetry has the opposite sign. A system with one
output runs on each axis. It does not know the current limit: an integrator in it winds up.

A system is recognised by its attributes: matrices, polynomials, or a method that returns matrices. Neither
python-control nor scipy is therefore required.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, shown, without_breaks

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


class LtiLaw(NamedTuple):
    """Parameters and state of a law that runs a linear system."""

    parameters: Array
    state: Array
    period_s: float


def lti_law(
    law: str, system: Any, inertia_kg_m2: ArrayLike | None = None, constant_torque_Nm: ArrayLike = 0.0
) -> LtiLaw:
    """Return the parameters with which `step` runs a system, and the state 0.

    Parameters
    ----------
    law : str
        Name of the law, for messages.
    system : discrete linear system
        Of python-control or scipy, or with their attributes.
    inertia_kg_m2 : float or (3,) array, kg·m², optional
        Factor of the outputs, if they are accelerations.
    constant_torque_Nm : float or (3,) array, N·m
        Added to the outputs.

    Raises
    ------
    InputError
        The system is not discrete, is improper, has inputs and outputs other than an error and a torque, or
        holds a number that is not finite.
    """
    period_s = _period(law, system)
    matrices = _for_all_axes(law, _validated(law, _state_space(law, system)))
    factor = np.ones(3) if inertia_kg_m2 is None else _per_axis(law, "inertia_kg_m2", inertia_kg_m2)
    constant = _per_axis(law, "constant_torque_Nm", constant_torque_Nm)
    A, B, C, D = matrices
    joined = np.block([[A, B], [factor[:, None] * C, factor[:, None] * D]])
    return LtiLaw(np.concatenate([constant, joined.ravel()]), np.zeros(2 * len(A)), period_s)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick; see `control.law.Law`.

    The second half of the state is working space for the next state. Sizes follow from the arrays, never from
    their values, which a scenario may set: arrays that fit no system give no torque.
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
    """Return the sampling time of a system, s."""
    dt: Any = getattr(system, "dt", None)
    is_number = isinstance(dt, int | float | np.integer | np.floating) and not isinstance(dt, bool)
    if not is_number or not 0 < dt < np.inf:  # None marks a continuous one of scipy, 0 one of python-control
        raise InputError(
            f"law {law}: expected a discrete system with its dt in s, received one with dt {shown(dt)};"
            f" {SAMPLE_FIRST}"
        )
    return float(dt)


def _state_space(law: str, system: Any) -> tuple[Any, ...]:
    """Return the matrices of a system, from its matrices or its polynomials."""
    try:
        if hasattr(system, "A"):
            return system.A, system.B, system.C, system.D
        if hasattr(system, "num"):
            return _realisation(law, *_polynomials(system))
        if hasattr(system, "to_ss"):
            matrices = system.to_ss()
            return matrices.A, matrices.B, matrices.C, matrices.D
    except InputError:
        raise
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(f"law {law}: expected {KINDS}, {without_breaks(error)}") from None
    raise InputError(f"law {law}: expected {KINDS}, received {shown(system)}")


def _polynomials(system: Any) -> tuple[Any, Any]:
    """Return numerators and denominators by output and input, with falling powers of z."""
    if isinstance(system.num, np.ndarray):  # of scipy: one input, and one denominator for all outputs
        rows = np.atleast_2d(system.num)
        return [[row] for row in rows], [[system.den] for _ in rows]
    return getattr(system, "num_list", system.num), getattr(system, "den_list", system.den)


def _realisation(law: str, numerators: Any, denominators: Any) -> StateSpace:
    """Return the controllable canonical forms of all entries in one system, with the states of all."""
    outputs, inputs = len(numerators), len(numerators[0])
    entries = [
        (i, j, _canonical(law, numerators[i][j], denominators[i][j]))
        for i in range(outputs)
        for j in range(inputs)
    ]
    states = sum(len(block.A) for _, _, block in entries)
    A, B = np.zeros((states, states)), np.zeros((states, inputs))
    C, D = np.zeros((outputs, states)), np.zeros((outputs, inputs))
    first = 0
    for i, j, block in entries:
        own = slice(first, first + len(block.A))
        A[own, own], B[own, j], C[i, own], D[i, j] = block.A, block.B[:, 0], block.C[0], block.D[0, 0]
        first = own.stop
    return StateSpace(A, B, C, D)


def _canonical(law: str, numerator: Any, denominator: Any) -> StateSpace:
    b, a = (
        np.trim_zeros(_real(law, "a transfer function", coefficients), "f")
        for coefficients in (numerator, denominator)
    )
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


def _validated(law: str, matrices: tuple[Any, ...]) -> StateSpace:
    """Return matrices of finite real numbers whose sizes fit each other."""
    A, B, C, D = (
        np.atleast_2d(_real(law, name, matrix)) for name, matrix in zip("ABCD", matrices, strict=True)
    )
    n, (p, m) = len(A) if A.size else 0, D.shape
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n)}
    for (name, shape), matrix in zip(shapes.items(), (A, B, C), strict=True):
        if matrix.shape != shape and (matrix.size or n):
            raise InputError(f"law {law}: expected {name} of shape {shape}, received {matrix.shape}")
    return StateSpace(A.reshape(n, n), B.reshape(n, m), C.reshape(p, n), D)


def _for_all_axes(law: str, single: StateSpace) -> StateSpace:
    """Return matrices from the errors of all axes to the torque on all axes."""
    outputs, inputs = single.D.shape
    if outputs == 3 and inputs in (3, 6):
        return single
    if outputs != 1 or inputs not in (1, 2):
        raise InputError(
            f"law {law}: expected 3 outputs of 3 or 6 inputs (the errors of the angles, then of the rates),"
            f" or 1 output of 1 or 2 for every axis, received {outputs} of {inputs}"
        )
    # Inputs come by row of the reference, then by axis, as `step` takes them.
    B = np.concatenate([_for_three_axes(single.B[:, [row]]) for row in range(inputs)], axis=1)
    D = np.concatenate([_for_three_axes(single.D[:, [row]]) for row in range(inputs)], axis=1)
    return StateSpace(_for_three_axes(single.A), B, _for_three_axes(single.C), D)


def _for_three_axes(block: Array) -> Array:
    return np.asarray(np.kron(np.eye(3), block), np.float64)


def _per_axis(law: str, name: str, value: ArrayLike) -> Array:
    numbers = _real(law, name, value)
    if numbers.shape not in ((), (3,)):
        raise InputError(f"law {law}: expected {name} as one number or three, received shape {numbers.shape}")
    return np.broadcast_to(numbers, 3)


def _real(law: str, name: str, value: Any) -> Array:
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        raise InputError(f"law {law}: expected {name} as an array, received {shown(value)}") from None
    if array.dtype.kind not in "biuf" or not np.all(np.isfinite(array)):
        raise InputError(f"law {law}: expected finite real numbers in {name}, received {shown(value)}")
    return array.astype(np.float64)
