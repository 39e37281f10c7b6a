"""Bounded allocation: currents for a torque on the rotor that use the whole range of the limit.

`control.allocation.least_norm` scales the least-norm currents as a whole: the first group at its limit
limits all others. Here the other groups continue. Of all currents within the limit that give the torque, the
smallest are computed; if there are none, those with the most torque in its direction. That is the direct
allocation of Durham (1993, doi:10.2514/3.21072), which Bodson (2002, doi:10.2514/2.4937) solves as a
linear programme.

The method follows a path. In units of the limit, the smallest z with ``G z = v`` and ``|z_j| <= 1`` are
``z = clip(G^T y)`` with three multipliers y. While v grows from zero along the desired torque, y moves on
straight lines, ``F F^T dy = dv`` with F the columns of the free groups, those below their limits. A line ends
where a group reaches its limit or leaves it. Where the free columns no longer span v, torque waits and
y moves along n, the part of v normal to all of them, until a group leaves its limit. If none does, every
group at its limit has the sign of ``g_j.n``: then ``n.G z`` is the sum of all ``|g_j.n|``, which no currents
exceed, and the torque is the largest. It is the parametric active-set method for quadratic programmes (Best
1996, in Applied Mathematics and Parallel Computing, Physica-Verlag, 57-76), with three equations. Its result
is checked: for columns that are almost in one plane it may fail, and then a simplex method is used.

A simplex method alone would reach the same torque, but along a path the currents change continuously with the
torque, also where it becomes infeasible. Continuous does not mean slow. Close to the largest torque, groups
with little torque an ampere go from limit to limit within a thousandth of the torque. For an infeasible
torque they jump as the rotor turns, where their columns pass through the plane of the free ones: there the
largest torque has several solutions. A torque some hundredths below the largest has one solution and smooth
currents.
"""

from math import copysign, inf, isfinite

from spheretwin.control.allocation.least_norm import allocate
from spheretwin.control.allocation.simplex import (
    NOISE,
    NONE,
    TIE,
    Vector,
    add_multiple,
    column,
    dot,
    increase_share,
    length,
    orthogonal_part,
    unit,
)
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import compiled

# Demands (desired currents of each group, in limits; beyond ±1 if it is at its limit), their rates along the
# line, the active limit of each group (-1, 1, or 0 if it is free), lengths of the columns, and steps.
SCRATCH_ROWS = 5

# A step takes one group to its limit or back. Poses of the actuator took at most 1.4 steps a group, symmetric
# and nearly singular matrices 1.9, except one in thousands: there this bound ends a cycle of the path.
STEPS_PER_GROUP = 2

# Shares of a vector's length that count as none: as a column's height over the plane of others, and as
# an error of the result.
FLAT = 1e-10
EXACT = 1e-11

# If the pivots of F F^T, as shares of its trace, are above this, it may be solved directly.
SOUND = 1e-6


@compiled
def allocate_bounded(G: Array, torque_S: Array, limit: float, current: Array, scratch: Array) -> float:
    """Compute the smallest currents within the limit for the torque, or else for the largest share of it.

    Never less torque than `control.allocation.least_norm.allocate` gives, and the same currents where they
    respect the limit.

    Parameters
    ----------
    G : (3, n) array, N·m/A
        Torque matrix at the present pose.
    torque_S : (3,) array, N·m
        Desired torque on the rotor, stator frame.
    limit : float, A
        Largest magnitude of any current.
    current : (n,) array, A
        Result.
    scratch : (5, n) array
        Working space, `SCRATCH_ROWS` rows; its content does not matter.

    Returns
    -------
    float
        Share of the desired torque that the currents give: 1, or less if no currents within the limit give
        the whole torque; 0 if the torque matrix has lost rank, or an argument is not finite.
    """
    scale = allocate(G, torque_S, limit, current)
    for j in range(current.shape[0]):
        if not isfinite(current[j]):
            scale = 0.0
    if not 0.0 < scale <= 1.0:
        current[:] = 0.0
        return 0.0
    if scale == 1.0:
        return 1.0
    largest = limit / scale
    start = (torque_S[0] / largest, torque_S[1] / largest, torque_S[2] / largest)  # what `allocate` gives
    end = 1.0 / scale
    share = reach(G, start, end, scratch)
    if not share >= 1.0:  # by rounding, or because of the bound on steps
        return scale
    for j in range(current.shape[0]):
        current[j] = clipped(scratch[0, j]) * limit
    return 1.0 if share == end else min(share * scale, 1.0)


@compiled
def reach(G: Array, torque: Vector, end: float, scratch: Array) -> float:
    """Compute demands within ±1 (first row of `scratch`) for `end` times a torque or for the largest share.

    Returns
    -------
    float
        The multiple of `torque` that they give.
    """
    demand = scratch[0]
    most_steps = STEPS_PER_GROUP * G.shape[1]
    share, normal, _ = follow_path(G, torque, end, most_steps, scratch)
    gives_share = length(residual(G, demand, torque, share)) <= EXACT * share * length(torque)
    if gives_share and (share == end or is_largest(G, demand, torque, share, normal)):
        return share
    if not gives_share:
        demand[:] = 0.0
        share = 0.0
    share, _ = increase_share(G, torque, end, share, most_steps, demand)
    return share


@compiled
def follow_path(
    G: Array, torque: Vector, end: float, most_steps: int, scratch: Array
) -> tuple[float, Vector, int]:
    """Compute the smallest demands within ±1 for a torque that grows from zero to `end` times the given one.

    Parameters
    ----------
    G : (3, n) array
        Torque matrix, of full rank.
    torque : tuple of three floats
        Torque in units of G: the torque of the currents, divided by their limit.
    end : float
        Multiple of `torque` at which to stop.
    most_steps : int
        Bound on the steps. Wherever the path ends, the demands give the share returned.
    scratch : (5, n) array
        The first row is the result: demands in units of the limit.

    Returns
    -------
    tuple of float, Vector and int
        Multiple of `torque` that the demands give; normal of the free columns; steps taken.
    """
    demand, rate, side, step = scratch[0], scratch[1], scratch[2], scratch[4]
    groups = G.shape[1]
    small = FLAT * start_path(G, scratch)
    share, steps = 0.0, 0
    while steps < most_steps and share < end:
        steps += 1
        y, grows = line_direction(G, side, torque, small)
        nearest = nearest_event(G, y, grows, scratch)
        remaining = end - share if grows else inf
        stride = min(nearest, remaining)
        if stride == inf:
            break
        for j in range(groups):
            demand[j] += stride * rate[j]
        if nearest >= remaining:
            share = end
        elif grows:
            share += stride
        if share < end:
            # Of groups that reach their limits at once the first is taken, which avoids cycles (Bland).
            for j in range(groups):
                if step[j] < inf and (step[j] - nearest) * abs(rate[j]) <= TIE:
                    demand[j] = side[j] if side[j] != 0.0 else copysign(1.0, rate[j])
                    side[j] = demand[j] - side[j]
                    break
    share, normal = remove_residual(G, torque, share, end, small, scratch)
    return share, normal, steps


@compiled
def start_path(G: Array, scratch: Array) -> float:
    """Start from zero demands, all groups free; return the length of the longest column."""
    demand, side, size = scratch[0], scratch[2], scratch[3]
    longest = 0.0
    for j in range(G.shape[1]):
        demand[j] = side[j] = 0.0
        size[j] = length(column(G, j))
        longest = max(longest, size[j])
    return longest


@compiled
def nearest_event(G: Array, y: Vector, grows: bool, scratch: Array) -> float:
    """Fill the demands' rates ``g_j.y`` and the steps to each group's next event; return the least step.

    A free group reaches the limit it moves towards; a group at its limit leaves it if it moves inwards. Rates
    of the size of rounding count as zero: they would free a group and limit it again without end.
    """
    demand, rate, side, size, step = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    G_x, G_y, G_z = G[0], G[1], G[2]
    noise = NOISE * length(y)
    for j in range(G.shape[1]):  # without branches, for the compiler to take several groups at once
        free = side[j] == 0.0
        w = G_x[j] * y[0] + G_y[j] * y[1] + G_z[j] * y[2]
        w = 0.0 if free and not grows else w  # y is normal to the free columns
        bound = copysign(1.0, w) if free else side[j]
        moves = (side[j] * w <= 0.0) & (abs(w) > noise * size[j])
        rate[j] = w
        step[j] = max((bound - demand[j]) / (w if moves else 1.0), 0.0) if moves else inf
    nearest = inf
    for j in range(G.shape[1]):
        nearest = min(nearest, step[j])
    return nearest


@compiled
def line_direction(G: Array, side: Array, torque: Vector, small: float) -> tuple[Vector, bool]:
    """Return the direction of the multipliers' next line, and whether the torque grows along it."""
    y, sound = multipliers(G, side, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), torque)
    if sound:
        return y, True
    e1, e2, e3 = free_frame(G, side, small)
    normal = orthogonal_part(orthogonal_part(torque, e1, e2), e3, NONE)
    if length(normal) > FLAT * length(torque):
        return normal, False
    y, _ = multipliers(G, side, e1, e2, e3, torque)
    return y, True


@compiled
def multipliers(
    G: Array, side: Array, e1: Vector, e2: Vector, e3: Vector, torque: Vector
) -> tuple[Vector, bool]:
    """Solve ``F F^T y = torque`` in the span of the orthonormal axes; an axis of zeros is left out.

    By ``L D L^T`` in the axes given. In those of `free_frame` the matrix is graded, that is, small only
    where the columns are, and its factors keep their accuracy although the matrix may be nearly singular.

    Returns
    -------
    tuple of Vector and bool
        y, and whether no pivot was small.
    """
    a = b = c = d = e = f = 0.0
    for j in range(G.shape[1]):  # F F^T = [[a, b, c], [b, d, e], [c, e, f]]
        free = 1.0 - side[j] * side[j]
        g = (free * G[0, j], free * G[1, j], free * G[2, j])
        g1, g2, g3 = dot(e1, g), dot(e2, g), dot(e3, g)
        a += g1 * g1
        b += g1 * g2
        c += g1 * g3
        d += g2 * g2
        e += g2 * g3
        f += g3 * g3
    least = SOUND * (a + d + f)
    pivot_1 = a if a > 0.0 else 1.0
    l21, l31 = b / pivot_1, c / pivot_1
    d -= l21 * b
    e -= l21 * c
    pivot_2 = d if d > 0.0 else 1.0
    l32 = e / pivot_2
    f -= l31 * c + l32 * e
    pivot_3 = f if f > 0.0 else 1.0
    x, y, z = dot(e1, torque), dot(e2, torque), dot(e3, torque)
    y -= l21 * x
    z = (z - l31 * x - l32 * y) / pivot_3
    y = y / pivot_2 - l32 * z
    x = x / pivot_1 - l21 * y - l31 * z
    return add_multiple(add_multiple(add_multiple(NONE, x, e1), y, e2), z, e3), min(a, d, f) > least


@compiled
def free_frame(G: Array, side: Array, small: float) -> tuple[Vector, Vector, Vector]:
    """Return orthonormal axes of the free columns' span, widest extent first; zeros for missing axes."""
    e1 = farthest(G, side, NONE, NONE, small)
    e2 = farthest(G, side, e1, NONE, small)
    e3 = farthest(G, side, e1, e2, small)
    return e1, e2, e3


@compiled
def farthest(G: Array, side: Array, e1: Vector, e2: Vector, small: float) -> Vector:
    """Return the unit vector to the free column farthest from two axes; zeros if none is beyond `small`."""
    best, square = NONE, small * small
    for j in range(G.shape[1]):
        if side[j] == 0.0:
            rest = orthogonal_part(column(G, j), e1, e2)
            if dot(rest, rest) > square:
                best, square = rest, dot(rest, rest)
    # A second time: the rounding error along the axes may be large relative to a short vector.
    return unit(orthogonal_part(unit(best), e1, e2))


@compiled
def remove_residual(
    G: Array, torque: Vector, share: float, end: float, small: float, scratch: Array
) -> tuple[float, Vector]:
    """Clip the demands; correct the free ones and the share for rounding along the path.

    Returns
    -------
    tuple of float and Vector
        The share, and the part of the torque that is normal to all free columns.
    """
    demand, side = scratch[0], scratch[2]
    for j in range(G.shape[1]):
        demand[j] = clipped(demand[j])
    rest = residual(G, demand, torque, share)
    e1, e2, e3 = free_frame(G, side, small)
    normal = orthogonal_part(orthogonal_part(torque, e1, e2), e3, NONE)
    if share < end and dot(normal, normal) > SOUND * dot(torque, torque):
        # The free groups cannot change the torque along the normal; the share can.
        share -= dot(normal, rest) / dot(normal, torque)
        rest = residual(G, demand, torque, share)
    y, _ = multipliers(G, side, e1, e2, e3, rest)
    for j in range(G.shape[1]):
        if side[j] == 0.0:
            demand[j] = clipped(demand[j] + dot(column(G, j), y))
    return share, normal


@compiled
def residual(G: Array, demand: Array, torque: Vector, share: float) -> Vector:
    """Return the part of the torque that the demands do not give."""
    rest = add_multiple(NONE, share, torque)
    for j in range(G.shape[1]):
        rest = add_multiple(rest, -demand[j], column(G, j))
    return rest


@compiled
def is_largest(G: Array, demand: Array, torque: Vector, share: float, normal: Vector) -> bool:
    """Return True if the normal proves that no demands within ±1 give a larger share."""
    unused = 0.0
    for j in range(G.shape[1]):
        along = dot(column(G, j), normal)
        unused += abs(along) - along * demand[j]
    reached = share * dot(normal, torque)
    return reached > 0.0 and unused <= EXACT * reached


@compiled
def clipped(demand: float) -> float:
    """Clip a demand to ±1, in units of the limit."""
    return min(max(demand, -1.0), 1.0)
