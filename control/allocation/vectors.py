"""Algebra of vectors in space as tuples, for compiled code that must not allocate."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import compiled

Vector = tuple[float, float, float]
Array = NDArray[np.float64]

NONE: Vector = (0.0, 0.0, 0.0)


@compiled
def column(G: Array, j: int) -> Vector:
    """Torque of one ampere in a group."""
    return G[0, j], G[1, j], G[2, j]


@compiled
def off(a: Vector, e1: Vector, e2: Vector) -> Vector:
    """What is left of a vector without its parts along two orthonormal axes (or zeros)."""
    return plus(plus(a, -dot(a, e1), e1), -dot(a, e2), e2)


@compiled
def unit(a: Vector) -> Vector:
    """Vector of length 1, or of zeros as it was."""
    square = dot(a, a)
    return plus(NONE, 1.0 / sqrt(square) if square > 0.0 else 0.0, a)


@compiled
def plus(a: Vector, factor: float, b: Vector) -> Vector:
    """Sum of a vector and a multiple of another."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@compiled
def length(a: Vector) -> float:
    """Euclidean length."""
    return sqrt(dot(a, a))


@compiled
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
