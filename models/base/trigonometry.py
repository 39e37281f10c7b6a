"""Sine and cosine without branches and calls, for vectors and for loops that the compiler vectorises."""

from __future__ import annotations

import numpy as np

from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.vectors import Vector

# pi/2 in two parts: the product of the first with a whole number up to 2**19 is exact.
_HALF_PI = 1.57079632673412561417, 6.07710050650619224932e-11

# Coefficients of fdlibm: up to pi/4, the errors of the polynomials are below 1e-17.
_S1, _S2, _S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
_S4, _S5, _S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
_C1, _C2, _C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
_C4, _C5, _C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11


LARGEST_rad = 1e5
"""Largest angle of `sine_cosine`."""


@inlined
def sine_cosine(x: Vector) -> tuple[Vector, Vector]:
    """Return sine and cosine of a vector or a number, rad: within 1e-15 up to `LARGEST_rad`.

    The quarter turn is chosen by arithmetic on whole numbers, not by comparison. The terms of the polynomials
    are summed in pairs: a chain of them would take twice the time.
    """
    quarters = np.floor(x * (2 / np.pi) + 0.5)
    r = x - quarters * _HALF_PI[0] - quarters * _HALF_PI[1]
    z = r * r
    z2 = z * z
    of_sine = (_S1 + z * _S2) + z2 * ((_S3 + z * _S4) + z2 * (_S5 + z * _S6))
    of_cosine = (_C1 + z * _C2) + z2 * ((_C3 + z * _C4) + z2 * (_C5 + z * _C6))
    sine, cosine = r + r * z * of_sine, (1.0 - 0.5 * z) + z2 * of_cosine
    odd = _odd(quarters)
    sign_of_sine = 1.0 - 2.0 * _odd(np.floor(0.5 * quarters))
    sign_of_cosine = 1.0 - 2.0 * _odd(np.floor(0.5 * (quarters + 1.0)))
    return sign_of_sine * (sine + odd * (cosine - sine)), sign_of_cosine * (cosine + odd * (sine - cosine))


@inlined
def _odd(number: Vector) -> Vector:
    """Return 1 for an odd whole number, 0 for an even one."""
    return number - 2.0 * np.floor(0.5 * number)
