/* SPDX-License-Identifier: MIT */
/* Vectors, and a simplex method with bounds: the largest torque in a direction that bounded currents give. */

typedef struct {
    st_real x, y, z;
} st_vector;

static st_vector st_column(st_real G[3][ST_GROUPS], int j)
{
    st_vector column;
    column.x = G[0][j];
    column.y = G[1][j];
    column.z = G[2][j];
    return column;
}

static st_real st_dot(st_vector a, st_vector b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static st_real st_length(st_vector a)
{
    return st_sqrt(st_dot(a, a));
}

/* a + factor b */
static st_vector st_add(st_vector a, st_real factor, st_vector b)
{
    a.x = a.x + factor * b.x;
    a.y = a.y + factor * b.y;
    a.z = a.z + factor * b.z;
    return a;
}

static st_vector st_scaled(st_real factor, st_vector a)
{
    a.x = factor * a.x;
    a.y = factor * a.y;
    a.z = factor * a.z;
    return a;
}

static st_vector st_cross(st_vector a, st_vector b)
{
    st_vector product;
    product.x = a.y * b.z - a.z * b.y;
    product.y = a.z * b.x - a.x * b.z;
    product.z = a.x * b.y - a.y * b.x;
    return product;
}

/* Vector without its components along two orthonormal axes, or zeros. */
static st_vector st_orthogonal(st_vector a, st_vector e1, st_vector e2)
{
    const st_vector rest = st_add(a, -st_dot(a, e1), e1);
    return st_add(rest, -st_dot(rest, e2), e2);
}

/* Vector of length 1; a zero vector stays zero. */
static st_vector st_unit(st_vector a)
{
    const st_real square = st_dot(a, a);
    return st_scaled(square > 0 ? 1 / st_sqrt(square) : 0, a);
}

/* Steps of a rate until a demand reaches its limit; infinity for a rate near rounding. */
static st_real st_steps_to_limit(st_real demand, st_real rate, st_real noise)
{
    const st_real distance = rate > 0 ? 1 - demand : 1 + demand;
    return st_fabs(rate) > noise ? st_greatest(distance, 0) / st_fabs(rate) : (st_real)HUGE_VAL;
}

/* Group that can add most to the share (-1: none), and the growth of the share with its demand. */
static int st_entering(st_real G[3][ST_GROUPS], const st_real *demand, st_vector plane, st_vector torque, int a,
    int b, st_real *growth)
{
    st_real best = 0, total = 0;
    int group = -1, j;
    *growth = 0;
    for (j = 0; j < ST_GROUPS; j++) {
        const st_real along = st_dot(st_column(G, j), plane) / st_dot(torque, plane);
        const st_real gain = st_fabs(along) - along * demand[j];
        total += st_fabs(along);
        if (gain > best && j != a && j != b) {
            best = gain;
            group = j;
            *growth = along;
        }
    }
    return best > ST_ROUNDING * total ? group : -1;
}

/* Increase the share to `end` or to its maximum. Two groups and the share are basic: they balance the change of
 * one other group at a time. */
static st_real st_increase_share(
    st_real G[3][ST_GROUPS], st_vector torque, st_real end, st_real share, int most_steps, st_real *demand)
{
    int a = 0, b = 0, j, steps;
    st_vector plane;
    for (j = 0; j < ST_GROUPS; j++) {
        if (st_length(st_cross(st_column(G, j), torque)) > st_length(st_cross(st_column(G, a), torque))) {
            a = j;
        }
    }
    plane = st_cross(st_column(G, a), torque);
    for (j = 0; j < ST_GROUPS; j++) {
        if (st_fabs(st_dot(st_column(G, j), plane)) > st_fabs(st_dot(st_column(G, b), plane))) {
            b = j;
        }
    }
    for (steps = 0; steps < most_steps && share < end; steps++) {
        const st_vector g_a = st_column(G, a), g_b = st_column(G, b);
        st_vector rest, g_c;
        st_real growth, rate_a, rate_b, rate_c, noise, room_a, room_b, room_c, remaining, stride;
        int c, a_meets, b_meets;
        plane = st_cross(g_a, g_b);
        c = st_entering(G, demand, plane, torque, a, b, &growth);
        if (c < 0) {
            break;
        }
        g_c = st_column(G, c);
        rate_c = st_copysign(1, growth);
        growth = st_fabs(growth);
        rest = st_add(st_scaled(growth, torque), -rate_c, g_c); /* a and b balance it */
        rate_a = st_dot(st_cross(rest, g_b), plane) / st_dot(plane, plane);
        rate_b = st_dot(st_cross(g_a, rest), plane) / st_dot(plane, plane);
        noise = ST_ROUNDING * (growth * st_length(torque) + st_length(g_c));
        room_a = st_steps_to_limit(demand[a], rate_a, noise / st_length(g_a));
        room_b = st_steps_to_limit(demand[b], rate_b, noise / st_length(g_b));
        room_c = st_steps_to_limit(demand[c], rate_c, 0);
        remaining = (end - share) / growth;
        stride = st_least(st_least(room_a, room_b), st_least(room_c, remaining));
        demand[a] += stride * rate_a;
        demand[b] += stride * rate_b;
        demand[c] += stride * rate_c;
        share = stride >= remaining ? end : share + stride * growth;
        a_meets = (room_a - stride) * st_fabs(rate_a) <= ST_ROUNDING;
        b_meets = (room_b - stride) * st_fabs(rate_b) <= ST_ROUNDING;
        if (stride >= room_c) {
            demand[c] = rate_c;
        } else if (a_meets && (st_fabs(rate_a) >= st_fabs(rate_b) || !b_meets)) {
            demand[a] = st_copysign(1, rate_a);
            a = c;
        } else if (b_meets) {
            demand[b] = st_copysign(1, rate_b);
            b = c;
        }
    }
    return share;
}
