/* SPDX-License-Identifier: MIT */
/* Allocation: the smallest currents within the limit for a torque, or for the largest share of it.
 *
 * In units of the limit, the smallest demands z with G z = v and |z_j| <= 1 are clip(G^T y). While v grows from
 * zero along the torque, y moves on straight lines, which end where a group reaches its limit or leaves it. The
 * result is checked; if it fails, a simplex method is used.
 */
#include "st_least_norm.h"
#include "st_simplex.h"

enum { ST_MOST_STEPS = 2 * ST_GROUPS }; /* a step takes one group to its limit or back */

typedef struct {
    st_real demand[ST_GROUPS];
    st_real rate[ST_GROUPS]; /* of the demands along the line */
    st_real side[ST_GROUPS]; /* active limit: -1, 1, or 0 if the group is free */
    st_real size[ST_GROUPS]; /* lengths of the columns */
    st_real step[ST_GROUPS]; /* to the next event of each group */
} st_path;

/* Unit vector to the free column farthest from two axes; zeros if none is beyond `small`. */
static st_vector st_farthest(
    st_real G[3][ST_GROUPS], const st_real *side, st_vector e1, st_vector e2, st_real small)
{
    st_vector best = {0, 0, 0};
    st_real square = small * small;
    int j;
    for (j = 0; j < ST_GROUPS; j++) {
        if (!(side[j] != 0)) {
            const st_vector rest = st_orthogonal(st_column(G, j), e1, e2);
            if (st_dot(rest, rest) > square) {
                best = rest;
                square = st_dot(rest, rest);
            }
        }
    }
    /* A second time: the rounding error along the axes may be large relative to a short vector. */
    return st_unit(st_orthogonal(st_unit(best), e1, e2));
}

/* Orthonormal axes of the span of the free columns, widest extent first; zeros for missing axes. */
static void st_free_frame(st_real G[3][ST_GROUPS], const st_real *side, st_real small, st_vector axes[3])
{
    const st_vector none = {0, 0, 0};
    axes[0] = st_farthest(G, side, none, none, small);
    axes[1] = st_farthest(G, side, axes[0], none, small);
    axes[2] = st_farthest(G, side, axes[0], axes[1], small);
}

/* Part of a vector that is normal to all free columns. */
static st_vector st_normal_part(st_vector torque, const st_vector axes[3])
{
    const st_vector none = {0, 0, 0};
    return st_orthogonal(st_orthogonal(torque, axes[0], axes[1]), axes[2], none);
}

/* Solve F F^T y = torque in the span of the axes, where F are the free columns; returns 1 if no pivot is small. */
static int st_multipliers(
    st_real G[3][ST_GROUPS], const st_real *side, const st_vector axes[3], st_vector torque, st_vector *y)
{
    st_real a = 0, b = 0, c = 0, d = 0, e = 0, f = 0, least, pivot_1, pivot_2, pivot_3, l21, l31, l32, u, v, w;
    int j;
    for (j = 0; j < ST_GROUPS; j++) {
        const st_vector g = st_scaled(1 - side[j] * side[j], st_column(G, j));
        const st_real g1 = st_dot(axes[0], g), g2 = st_dot(axes[1], g), g3 = st_dot(axes[2], g);
        a += g1 * g1;
        b += g1 * g2;
        c += g1 * g3;
        d += g2 * g2;
        e += g2 * g3;
        f += g3 * g3;
    }
    least = ST_SOUND * (a + d + f);
    pivot_1 = a > 0 ? a : 1;
    l21 = b / pivot_1;
    l31 = c / pivot_1;
    d -= l21 * b;
    e -= l21 * c;
    pivot_2 = d > 0 ? d : 1;
    l32 = e / pivot_2;
    f -= l31 * c + l32 * e;
    pivot_3 = f > 0 ? f : 1;
    u = st_dot(axes[0], torque);
    v = st_dot(axes[1], torque);
    w = st_dot(axes[2], torque);
    v -= l21 * u;
    w = (w - l31 * u - l32 * v) / pivot_3;
    v = v / pivot_2 - l32 * w;
    u = u / pivot_1 - l21 * v - l31 * w;
    *y = st_add(st_add(st_scaled(u, axes[0]), v, axes[1]), w, axes[2]);
    return st_least(st_least(a, d), f) > least;
}

/* Direction of the multipliers' next line; returns 1 if the torque grows along it. */
static int st_line_direction(
    st_real G[3][ST_GROUPS], const st_real *side, st_vector torque, st_real small, st_vector *y)
{
    const st_vector frame[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    st_vector axes[3], normal;
    if (st_multipliers(G, side, frame, torque, y)) {
        return 1;
    }
    st_free_frame(G, side, small, axes);
    normal = st_normal_part(torque, axes);
    if (st_length(normal) > ST_FLAT * st_length(torque)) {
        *y = normal;
        return 0;
    }
    (void)st_multipliers(G, side, axes, torque, y);
    return 1;
}

/* Rates of the demands and steps to the next event of each group; returns the least step. */
static st_real st_nearest_event(st_real G[3][ST_GROUPS], st_vector y, int grows, st_path *path)
{
    const st_real noise = ST_ROUNDING * st_length(y);
    st_real nearest = (st_real)HUGE_VAL;
    int j;
    for (j = 0; j < ST_GROUPS; j++) {
        const int is_free = !(path->side[j] != 0);
        const st_real w = is_free && !grows ? 0 : st_dot(st_column(G, j), y);
        const st_real bound = is_free ? st_copysign(1, w) : path->side[j];
        path->rate[j] = w;
        path->step[j] = (st_real)HUGE_VAL;
        if (path->side[j] * w <= 0 && st_fabs(w) > noise * path->size[j]) {
            path->step[j] = st_greatest((bound - path->demand[j]) / w, 0);
        }
        nearest = st_least(nearest, path->step[j]);
    }
    return nearest;
}

/* Part of the torque that the demands do not give. */
static st_vector st_residual(st_real G[3][ST_GROUPS], const st_real *demand, st_vector torque, st_real share)
{
    st_vector rest = st_scaled(share, torque);
    int j;
    for (j = 0; j < ST_GROUPS; j++) {
        rest = st_add(rest, -demand[j], st_column(G, j));
    }
    return rest;
}

/* Clip the demands; correct the free ones and the share for rounding along the path. */
static st_real st_remove_residual(st_real G[3][ST_GROUPS], st_vector torque, st_real share, st_real end,
    st_real small, st_path *path, st_vector *normal)
{
    st_vector rest, axes[3], y;
    int j;
    for (j = 0; j < ST_GROUPS; j++) {
        path->demand[j] = st_within(path->demand[j], 1);
    }
    rest = st_residual(G, path->demand, torque, share);
    st_free_frame(G, path->side, small, axes);
    *normal = st_normal_part(torque, axes);
    if (share < end && st_dot(*normal, *normal) > ST_SOUND * st_dot(torque, torque)) {
        share -= st_dot(*normal, rest) / st_dot(*normal, torque);
        rest = st_residual(G, path->demand, torque, share);
    }
    (void)st_multipliers(G, path->side, axes, rest, &y);
    for (j = 0; j < ST_GROUPS; j++) {
        if (!(path->side[j] != 0)) {
            path->demand[j] = st_within(path->demand[j] + st_dot(st_column(G, j), y), 1);
        }
    }
    return share;
}

/* Smallest demands within 1 for a torque that grows from zero to `end` times the given one. */
static st_real st_follow_path(
    st_real G[3][ST_GROUPS], st_vector torque, st_real end, st_path *path, st_vector *normal)
{
    const st_real infinite = (st_real)HUGE_VAL;
    st_real share = 0, longest = 0, small;
    int steps, j;
    for (j = 0; j < ST_GROUPS; j++) {
        path->demand[j] = path->side[j] = 0;
        path->size[j] = st_length(st_column(G, j));
        longest = st_greatest(longest, path->size[j]);
    }
    small = ST_FLAT * longest;
    for (steps = 0; steps < ST_MOST_STEPS && share < end; steps++) {
        st_vector y;
        const int grows = st_line_direction(G, path->side, torque, small, &y);
        const st_real nearest = st_nearest_event(G, y, grows, path);
        const st_real remaining = grows ? end - share : infinite;
        const st_real stride = st_least(nearest, remaining);
        if (stride >= infinite) {
            break;
        }
        for (j = 0; j < ST_GROUPS; j++) {
            path->demand[j] += stride * path->rate[j];
        }
        if (nearest >= remaining) {
            share = end;
        } else if (grows) {
            share += stride;
        }
        /* Of groups that reach their limits at once the first is taken, which avoids cycles (Bland). */
        for (j = 0; j < ST_GROUPS && share < end; j++) {
            if (path->step[j] < infinite && (path->step[j] - nearest) * st_fabs(path->rate[j]) <= ST_ROUNDING) {
                path->demand[j] = path->side[j] != 0 ? path->side[j] : st_copysign(1, path->rate[j]);
                path->side[j] = path->demand[j] - path->side[j];
                break;
            }
        }
    }
    return st_remove_residual(G, torque, share, end, small, path, normal);
}

/* 1 if the normal proves that no demands within 1 give a larger share. */
static int st_is_largest(
    st_real G[3][ST_GROUPS], const st_real *demand, st_vector torque, st_real share, st_vector normal)
{
    const st_real reached = share * st_dot(normal, torque);
    st_real unused = 0;
    int j;
    for (j = 0; j < ST_GROUPS; j++) {
        const st_real along = st_dot(st_column(G, j), normal);
        unused += st_fabs(along) - along * demand[j];
    }
    return reached > 0 && unused <= ST_EXACT * reached;
}

/* Demands within 1 for `end` times a torque or for the largest share; returns the multiple that they give. */
static st_real st_reach(st_real G[3][ST_GROUPS], st_vector torque, st_real end, st_path *path)
{
    st_vector normal;
    st_real share = st_follow_path(G, torque, end, path, &normal);
    const st_vector rest = st_residual(G, path->demand, torque, share);
    int j;
    if (st_length(rest) <= ST_EXACT * share * st_length(torque)) {
        if (share >= end || st_is_largest(G, path->demand, torque, share, normal)) {
            return share;
        }
    } else {
        for (j = 0; j < ST_GROUPS; j++) {
            path->demand[j] = 0;
        }
        share = 0;
    }
    return st_increase_share(G, torque, end, share, ST_MOST_STEPS, path->demand);
}

static st_real st_allocate(
    st_real G[3][ST_GROUPS], const st_real torque[3], st_real limit, st_real current[ST_GROUPS])
{
    st_real scale = st_least_norm(G, torque, limit, current), end, share;
    st_vector start;
    st_path path;
    int j;
    for (j = 0; j < ST_GROUPS; j++) {
        if (!st_finite(current[j])) {
            scale = 0;
        }
    }
    if (!(scale > 0)) {
        for (j = 0; j < ST_GROUPS; j++) {
            current[j] = 0;
        }
        return 0;
    }
    if (scale >= 1) {
        return 1;
    }
    start.x = torque[0] / (limit / scale); /* the torque that the least-norm currents give, in limits */
    start.y = torque[1] / (limit / scale);
    start.z = torque[2] / (limit / scale);
    end = 1 / scale;
    share = st_reach(G, start, end, &path);
    if (!(share >= 1)) { /* by rounding, or because of the bound on steps */
        return scale;
    }
    for (j = 0; j < ST_GROUPS; j++) {
        current[j] = st_within(path.demand[j], 1) * limit;
    }
    return share >= end ? 1 : st_least(share * scale, 1);
}
