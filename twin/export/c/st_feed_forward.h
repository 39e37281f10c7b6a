/* SPDX-License-Identifier: MIT */
/* Feed-forward of friction and inertia torques of the nominal model along the reference. */

/* Torque of this tick; the one that acted over the last period is subtracted from the applied torque. */
static void st_feed_forward(
    st_controller *controller, st_real reference[3][3], st_real applied_torque[3], st_real fed[3])
{
    const st_real *v = reference[1], f = ST_FEED_FORWARD_FRACTION;
    st_real inertial[3];
    int i, row;
    st_motion_torque(ST_FEED_FORWARD_INERTIA, reference[0], v, reference[2], inertial);
    for (i = 0; i < 3; i++) {
        const st_real smoothing = ST_FEED_FORWARD_SMOOTHING;
        const st_real k = ST_FEED_FORWARD_VISCOUS[i]
            + ST_FEED_FORWARD_COULOMB[i] / st_sqrt(v[i] * v[i] + smoothing * smoothing);
        applied_torque[i] -= f * controller->fed_forward[ST_FED_FORWARD - 1][i]
            + (1 - f) * controller->fed_forward[ST_FED_FORWARD - 2][i];
        fed[i] = k * v[i] + ST_FEED_FORWARD_SHARE[i] * inertial[i];
        for (row = ST_FED_FORWARD - 1; row > 0; row--) {
            controller->fed_forward[row][i] = controller->fed_forward[row - 1][i];
        }
        controller->fed_forward[0][i] = fed[i];
    }
}
