/* SPDX-License-Identifier: MIT */
/* Feedback of error, rate and integral, with back-calculation of the integral from the applied torque. */
#include "st_command_history.h"

static void st_law(
    const st_real reference[3][3], const st_real measurement[3][3], st_real *state, st_real torque[3])
{
    enum { STIFFNESS = 0, DAMPING = 3, INTEGRAL = 6, TRACKING = 9, FRACTION = 12, PERIOD = 13, HISTORY = 3 };
    const st_real *parameters = ST_LAW_PARAMETERS;
    const st_real period = parameters[PERIOD];
    const int rows = (ST_LAW_STATE - HISTORY) / 3;
    int axis;
    for (axis = 0; axis < 3; axis++) {
        const st_real error = measurement[0][axis] - reference[0][axis];
        const st_real error_rate = measurement[1][axis] - reference[1][axis];
        const st_real torque_error
            = measurement[2][axis] - st_delayed_command(state + HISTORY, rows, axis, parameters[FRACTION]);
        state[axis] += period * parameters[TRACKING + axis] * torque_error;
        torque[axis] = state[axis] - parameters[STIFFNESS + axis] * error
            - parameters[DAMPING + axis] * error_rate;
        state[axis] -= period * parameters[INTEGRAL + axis] * error;
    }
    st_store_command(state + HISTORY, rows, torque);
}
