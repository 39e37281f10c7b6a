"""Simplex method with bounds: the largest torque in a direction that bounded currents give."""

from math import copysign, inf, sqrt

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import compiled

Vector = tuple[float, float, float]

NONE: Vector = (0.0, 0.0, 0.0)


@compiled
def column(G: Array, j: int) -> Vector:
    """Return the torque of one ampere in a group."""
    return G[0, j], G[1, j], G[2, j]


@compiled
def orthogonal_part(a: Vector, e1: Vector, e2: Vector) -> Vector:
    """Return a vector without its components along two orthonormal axes (or zeros)."""
    return add_multiple(add_multiple(a, -dot(a, e1), e1), -dot(a, e2), e2)


@compiled
def unit(a: Vector) -> Vector:
    """Return the vector scaled to length 1; a zero vector stays zero."""
    square = dot(a, a)
    return add_multiple(NONE, 1.0 / sqrt(square) if square > 0.0 else 0.0, a)


@compiled
def add_multiple(a: Vector, factor: float, b: Vector) -> Vector:
    """Return the sum of a vector and a multiple of another."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@compiled
def length(a: Vector) -> float:
    """Return the Euclidean length."""
    return sqrt(dot(a, a))


@compiled
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


# Share of the terms' size below which a rate or a gain is rounding.
NOISE = 1e-12

# Groups within this distance of their limits (in limits) count as being at them.
TIE = 1e-12


@compiled
def increase_share(
    G: Array, torque: Vector, end: float, share: float, most_steps: int, demand: Array
) -> tuple[float, int]:
    """Increase the share, by a simplex method with bounds, to `end` or to its maximum.

    Two groups and the share are basic: they balance the change of one other group at a time.

    Parameters
    ----------
    G : (3, n) array
    torque : tuple of three floats
    end : float
    share : float
        Share of the torque that the demands give at the start.
    most_steps : int
    demand : (n,) array
        Within ±1, changed in place.

    Returns
    -------
    tuple of float and int
        The share, and steps taken.
    """
    a, b = first_basis(G, torque)
    steps = 0
    while steps < most_steps and share < end:
        steps += 1
        g_a, g_b = column(G, a), column(G, b)
        plane = cross(g_a, g_b)
        c, growth = entering(G, demand, plane, torque, a, b)
        if c < 0:
            break
        rate_c, growth = copysign(1.0, growth), abs(growth)
        rest = add_multiple(add_multiple(NONE, growth, torque), -rate_c, column(G, c))  # a and b balance it
        rate_a = dot(cross(rest, g_b), plane) / dot(plane, plane)
        rate_b = dot(cross(g_a, rest), plane) / dot(plane, plane)
        noise = NOISE * (growth * length(torque) + length(column(G, c)))
        room_a = steps_to_limit(demand[a], rate_a, noise / length(g_a))
        room_b = steps_to_limit(demand[b], rate_b, noise / length(g_b))
        room_c = steps_to_limit(demand[c], rate_c, 0.0)
        remaining = (end - share) / growth
        stride = min(room_a, room_b, room_c, remaining)
        demand[a] += stride * rate_a
        demand[b] += stride * rate_b
        demand[c] += stride * rate_c
        share = end if stride == remaining else share + stride * growth
        a_meets = (room_a - stride) * abs(rate_a) <= TIE
        b_meets = (room_b - stride) * abs(rate_b) <= TIE
        if stride == room_c:
            demand[c] = rate_c
        elif a_meets and (
            abs(rate_a) >= abs(rate_b) or not b_meets
        ):  # the faster: the next basis is better conditioned
            demand[a] = copysign(1.0, rate_a)
            a = c
        elif b_meets:
            demand[b] = copysign(1.0, rate_b)
            b = c
    return share, steps


@compiled
def first_basis(G: Array, torque: Vector) -> tuple[int, int]:
    """Return two groups whose columns and the torque are far from coplanar."""
    a = b = 0
    for j in range(G.shape[1]):
        if length(cross(column(G, j), torque)) > length(cross(column(G, a), torque)):
            a = j
    plane = cross(column(G, a), torque)
    for j in range(G.shape[1]):
        if abs(dot(column(G, j), plane)) > abs(dot(column(G, b), plane)):
            b = j
    return a, b


@compiled
def entering(G: Array, demand: Array, plane: Vector, torque: Vector, a: int, b: int) -> tuple[int, float]:
    """Return the group that can add most to the share (-1: none), and the share's growth with its demand."""
    best, best_group, best_growth, total = 0.0, -1, 0.0, 0.0
    for j in range(G.shape[1]):
        growth = dot(column(G, j), plane) / dot(torque, plane)
        gain = abs(growth) - growth * demand[j]
        total += abs(growth)
        if gain > best and j != a and j != b:
            best, best_group, best_growth = gain, j, growth
    return (best_group if best > NOISE * total else -1), best_growth


@compiled
def steps_to_limit(demand: float, rate: float, noise: float) -> float:
    """Return the steps of a rate until a demand reaches its limit; infinity for a rate near rounding."""
    distance = 1.0 - demand if rate > 0.0 else 1.0 + demand
    return max(distance, 0.0) / abs(rate) if abs(rate) > noise else inf
