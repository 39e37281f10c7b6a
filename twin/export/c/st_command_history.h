/* SPDX-License-Identifier: MIT */
/* History of the commanded torques of a law, newest first, in rows of three numbers. */

/* Torque that was commanded for the last period. */
static st_real st_delayed_command(const st_real *history, int rows, int axis, st_real fraction)
{
    return fraction * history[3 * (rows - 1) + axis] + (1 - fraction) * history[3 * (rows - 2) + axis];
}

static void st_store_command(st_real *history, int rows, const st_real torque[3])
{
    int row, axis;
    for (axis = 0; axis < 3; axis++) {
        for (row = rows - 1; row > 0; row--) {
            history[3 * row + axis] = history[3 * (row - 1) + axis];
        }
        history[axis] = torque[axis];
    }
}
