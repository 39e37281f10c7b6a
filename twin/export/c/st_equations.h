/* SPDX-License-Identifier: MIT */
/* Motion and torque matrix, for one type of numbers.
 *
 * The file is included once for each type T. NAME(x) gives the functions names of their own, RE(x) is the
 * real part of a number. A model header defines the sizes and tables with the prefix ST_.
 * Frames: S is the stator, R the rotor; q = (alpha, beta, gamma) turns about x, y, z in this order.
 */

typedef struct {
    T alpha, beta, gamma, alpha_beta, alpha_gamma, beta_gamma;
} NAME(inertia); /* entries of the inertia matrix, kg m^2 */

#include ST_MOTION /* generated */

/* Torque matrix at a pose, N m/A: column j is the torque of one ampere in group j, in frame S.
 *
 * h(cos phi) = (f_t(phi) - f_t(pi - phi)) / sin(phi) is looked up as a cubic in cos phi. */
static inline void NAME(torque_matrix)(const T q[3], T G[3][ST_GROUPS])
{
    T R[3][3];
    int i, j, line;
    NAME(rotation)(q, R);
    for (j = 0; j < ST_GROUPS; j++) {
        G[0][j] = G[1][j] = G[2][j] = 0;
    }
    for (line = 0; line < ST_LINES; line++) {
        const ST_NUMBER *r = ST_LINE_AXES[line];
        T axis[3], pull[3];
        for (i = 0; i < 3; i++) {
            axis[i] = R[i][0] * r[0] + R[i][1] * r[1] + R[i][2] * r[2];
            pull[i] = ST_LINE_WEIGHTS[line] * axis[i];
        }
        for (j = 0; j < ST_GROUPS; j++) {
            T cosine = axis[0] * ST_GROUP_AXES[0][j] + axis[1] * ST_GROUP_AXES[1][j]
                + axis[2] * ST_GROUP_AXES[2][j];
            T beyond = 0, row, t, h;
            const ST_NUMBER *cubic;
            int place;
#if ST_SCATTER
            const ST_NUMBER side = RE(cosine) < 0 ? -1 : 1;
            cosine += (ST_PAIR_STRETCH[0][line][j] + side * ST_PAIR_STRETCH[1][line][j]) * (side - cosine);
#endif
            if (RE(cosine) > ST_KNEE) {
                beyond = cosine - ST_KNEE;
            } else if (RE(cosine) < -ST_KNEE) {
                beyond = cosine + ST_KNEE;
            }
            row = ST_CENTRE + ST_WIDE * cosine + (ST_NARROW - ST_WIDE) * beyond;
            /* 0 also for a row that rounds below it, and for one that is no number */
            place = RE(row) >= 1 ? RE(row) < ST_ROWS ? (int)RE(row) : ST_ROWS - 1 : 0;
            t = row - (ST_NUMBER)place;
            cubic = ST_TABLE[place];
            h = cubic[0] + t * (cubic[1] + t * (cubic[2] + t * cubic[3]));
#if ST_SCATTER
            h *= ST_PAIR_GAIN[0][line][j] + (RE(row) < ST_CENTRE ? -1 : 1) * ST_PAIR_GAIN[1][line][j];
#endif
            for (i = 0; i < 3; i++) {
                G[i][j] += h * pull[i];
            }
        }
    }
    for (j = 0; j < ST_GROUPS; j++) { /* so far the sum of pulls; now its cross product with the axes */
        const T x = G[0][j], y = G[1][j], z = G[2][j];
        G[0][j] = y * ST_GROUP_AXES[2][j] - z * ST_GROUP_AXES[1][j];
        G[1][j] = z * ST_GROUP_AXES[0][j] - x * ST_GROUP_AXES[2][j];
        G[2][j] = x * ST_GROUP_AXES[1][j] - y * ST_GROUP_AXES[0][j];
    }
}
