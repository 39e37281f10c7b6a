/* SPDX-License-Identifier: MIT */
/* Filtered difference: the backward difference of the angle through a first-order low-pass. */
static void st_estimate_rates(st_real angle[3], const st_real measured[3], st_real *state, st_real rate[3])
{
    enum { DECAY = 0, GAIN = 3, STARTED = 0, ANGLE = 3, RATE = 6 };
    int axis;
    (void)measured;
    for (axis = 0; axis < 3; axis++) {
        const st_real decay = ST_ESTIMATOR_PARAMETERS[DECAY + axis], gain = ST_ESTIMATOR_PARAMETERS[GAIN + axis];
        const st_real now = angle[axis];
        st_real change;
        if (!(state[STARTED + axis] != 0)) {
            state[STARTED + axis] = 1;
            state[ANGLE + axis] = now;
            state[RATE + axis] = 0;
        }
        change = now - state[ANGLE + axis];
        if (st_jumped(change, (1 - decay) / gain)) {
            rate[axis] = state[RATE + axis];
        } else {
            rate[axis] = decay * state[RATE + axis] + gain * change;
        }
        state[ANGLE + axis] = now;
        state[RATE + axis] = rate[axis];
    }
}
