/* SPDX-License-Identifier: MIT */
/* Proportional-derivative law. */
static void st_law(
    const st_real reference[3][3], const st_real measurement[3][3], st_real *state, st_real torque[3])
{
    enum { STIFFNESS = 0, DAMPING = 3, FACTOR = 6 };
    const st_real *parameters = ST_LAW_PARAMETERS;
    int axis;
    (void)state;
    for (axis = 0; axis < 3; axis++) {
        const st_real error = measurement[0][axis] - reference[0][axis];
        const st_real error_rate = measurement[1][axis] - reference[1][axis];
        torque[axis] = -parameters[FACTOR + axis]
            * (parameters[STIFFNESS + axis] * error + parameters[DAMPING + axis] * error_rate);
    }
}
