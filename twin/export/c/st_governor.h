/* SPDX-License-Identifier: MIT */
/* Reference governor: limits the acceleration of the reference on each axis. */

/* Acceleration within a bound that takes x+ = x + h v, v+ = v + h u to rest at 0 in nearly the least time. */
static st_real st_fhan(st_real x, st_real v, st_real largest, st_real h)
{
    const st_real reach = largest * h * h, after = x + h * v;
    st_real switching = h * v + after;
    if (st_fabs(after) > reach) {
        switching = h * v
            + st_copysign((st_real)0.5, after) * (st_sqrt(reach * (reach + 8 * st_fabs(after))) - reach);
    }
    return -largest * st_within(switching / reach, 1);
}

/* Replace the reference by the governed one. */
static void st_govern(st_controller *controller, st_real measurement[3][3], st_real reference[3][3])
{
    st_real(*motion)[3] = controller->governed;
    const st_real h = ST_PERIOD_S;
    int axis, row;
    for (axis = 0; axis < 3; axis++) {
        const st_real largest = ST_GOVERNOR_LARGEST[axis];
        st_real acceleration = reference[2][axis], spare, angle_error, rate_error;
        if (!controller->governed_started) {
            motion[0][axis] = measurement[0][axis];
            motion[1][axis] = measurement[1][axis];
        } else {
            motion[0][axis] += h * (motion[1][axis] + h * motion[2][axis] / 2);
            motion[1][axis] += h * motion[2][axis];
        }
        spare = st_greatest(largest - st_fabs(acceleration), (st_real)0.1 * largest);
        angle_error = motion[0][axis] - reference[0][axis];
        rate_error = motion[1][axis] - reference[1][axis];
        acceleration += st_fhan(angle_error - h * rate_error / 2, rate_error, spare, h);
        motion[2][axis] = st_within(acceleration, largest);
        for (row = 0; row < 3; row++) {
            reference[row][axis] = motion[row][axis];
        }
    }
    controller->governed_started = 1;
}
