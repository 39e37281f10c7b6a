/* SPDX-License-Identifier: MIT */
/* Adaptive fuzzy sliding mode. */
#include "st_fuzzy.h"

static void st_law(
    const st_real reference[3][3], const st_real measurement[3][3], st_real *state, st_real torque[3])
{
    enum { SLOPE = 0, REACHING = 3, FUZZY_RATE = 6, SWITCHING_RATE = 9, BOUND_RATE = 12, FACTOR = 15, PERIOD = 18 };
    enum { SLIDING = 0, FUZZY = 3, SWITCHING = 6, XI = 9, ZETA = 12, THETA = 15 };
    const st_real *parameters = ST_LAW_PARAMETERS;
    const st_real period = parameters[PERIOD];
    int axis;
    for (axis = 0; axis < 3; axis++) {
        const st_real angle = measurement[0][axis], rate = measurement[1][axis];
        const st_real error = angle - reference[0][axis], error_rate = rate - reference[1][axis];
        const st_real s = parameters[SLOPE + axis] * error + error_rate;
        const st_real coupling = 1 + st_fabs(s) + s * s;
        const st_real drive = -parameters[FUZZY_RATE + axis] * s * period;
        const st_real fuzzy = st_approximate(rate, angle, drive, state + THETA + ST_CONSEQUENTS * axis);
        const st_real sign = s > 0 ? 1 : s < 0 ? -1 : s;
        const st_real switching = -sign * (state[XI + axis] + state[ZETA + axis] * coupling);
        const st_real factor = parameters[FACTOR + axis];
        torque[axis] = factor * (fuzzy + switching - parameters[REACHING + axis] * s);
        state[SLIDING + axis] = s;
        state[FUZZY + axis] = factor * fuzzy;
        state[SWITCHING + axis] = factor * switching;
        state[XI + axis] += parameters[SWITCHING_RATE + axis] * st_fabs(s) * period;
        state[ZETA + axis] += parameters[BOUND_RATE + axis] * st_fabs(s) * coupling * period;
    }
}
