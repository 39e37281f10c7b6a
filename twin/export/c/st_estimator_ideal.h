/* SPDX-License-Identifier: MIT */
/* No estimator: the law receives the measured rates. */
static void st_estimate_rates(st_real angle[3], const st_real measured[3], st_real *state, st_real rate[3])
{
    int axis;
    (void)angle, (void)state;
    for (axis = 0; axis < 3; axis++) {
        rate[axis] = measured[axis];
    }
}
