/* SPDX-License-Identifier: MIT */
/* Levant's differentiator of second order, implicit. */

/* The u >= 0 with u^3 + 2 u^2 + 2.12 u = rest >= 0, by Newton's method from above. */
static st_real st_root(st_real rest)
{
    const st_real middle = (st_real)2.12, third = (st_real)(1.0 / 3);
    st_real u = st_least(st_least(st_pow(rest, third), st_sqrt(rest / 2)), rest / middle);
    u *= 1 + ST_ABOVE;
    for (;;) {
        const st_real excess = ((u + 2) * u + middle) * u - rest;
        const st_real lower = u - excess / ((3 * u + 4) * u + middle);
        if (!(lower < u)) {
            return u;
        }
        u = lower;
    }
}

static void st_estimate_rates(st_real angle[3], const st_real measured[3], st_real *state, st_real rate[3])
{
    enum { PERIOD = 0, FILTERS = 1, JERK = 2, STARTED = 0, ANGLE = 3, RATE = 6, ACCELERATION = 9, LAST = 12 };
    const st_real *parameters = ST_ESTIMATOR_PARAMETERS;
    const st_real period = parameters[PERIOD], inner = (st_real)1.1;
    int axis;
    (void)measured;
    for (axis = 0; axis < 3; axis++) {
        const st_real now = angle[axis], unit = parameters[JERK + axis] * period;
        st_real change, predicted, ahead, error, clipped, u, sign;
        if (!(state[STARTED + axis] != 0)) {
            state[STARTED + axis] = 1;
            state[ANGLE + axis] = state[LAST + axis] = now;
            state[RATE + axis] = state[ACCELERATION + axis] = 0;
        }
        change = now - state[LAST + axis];
        state[LAST + axis] = now;
        if (st_jumped(change, period)) {
            state[ANGLE + axis] = now;
            state[ACCELERATION + axis] = 0;
            rate[axis] = state[RATE + axis];
            continue;
        }
        predicted = state[RATE + axis] + period * state[ACCELERATION + axis];
        ahead = state[ANGLE + axis] + period / 2 * (state[RATE + axis] + predicted) - now;
        error = st_fabs(ahead) / (unit * period * period);
        clipped = st_least(error, inner);
        u = st_root(error - clipped);
        sign = st_copysign(1, ahead);
        state[ANGLE + axis] = now + sign * (unit * period * period) * (u * u * u);
        state[RATE + axis]
            = predicted - sign * (unit * period) * ((st_real)2.12 * u + (st_real)1.5 * clipped);
        state[ACCELERATION + axis] -= sign * unit * clipped;
        rate[axis] = state[RATE + axis];
        if (parameters[FILTERS] != 0) {
            angle[axis] = state[ANGLE + axis];
        }
    }
}
