/* SPDX-License-Identifier: MIT */
/* Steady-state Kalman filter of angle and rate. */
static void st_estimate_rates(st_real angle[3], const st_real measured[3], st_real *state, st_real rate[3])
{
    enum { OF_ANGLE = 0, OF_RATE = 3, PERIOD = 6, FILTERS = 7, STARTED = 0, ANGLE = 3, RATE = 6, LAST = 9 };
    const st_real *parameters = ST_ESTIMATOR_PARAMETERS;
    int axis;
    (void)measured;
    for (axis = 0; axis < 3; axis++) {
        const st_real now = angle[axis];
        st_real change, predicted, innovation;
        if (!(state[STARTED + axis] != 0)) {
            state[STARTED + axis] = 1;
            state[ANGLE + axis] = state[LAST + axis] = now;
            state[RATE + axis] = 0;
        }
        change = now - state[LAST + axis];
        state[LAST + axis] = now;
        if (st_jumped(change, parameters[PERIOD])) {
            state[ANGLE + axis] = now;
            rate[axis] = state[RATE + axis];
            continue;
        }
        predicted = state[ANGLE + axis] + parameters[PERIOD] * state[RATE + axis];
        innovation = now - predicted;
        state[ANGLE + axis] = predicted + parameters[OF_ANGLE + axis] * innovation;
        state[RATE + axis] += parameters[OF_RATE + axis] * innovation;
        rate[axis] = state[RATE + axis];
        if (parameters[FILTERS] != 0) {
            angle[axis] = state[ANGLE + axis];
        }
    }
}
