/* SPDX-License-Identifier: MIT */
/* Kinematics, equations of motion of an ideal joint, and torque matrix, for one type of numbers.
 *
 * The file is included once for each type T. NAME(x) gives the functions names of their own, RE(x) is the
 * real part of a number. A model header defines the sizes and tables with the prefix ST_.
 * Frames: S is the stator, R the rotor; q = (alpha, beta, gamma) turns about x, y, z in this order.
 */

typedef struct {
    T ca, sa, cb, sb, cg, sg;
} NAME(turns); /* cosines and sines of a pose */

typedef struct {
    T alpha, beta, gamma, alpha_beta, alpha_gamma, beta_gamma;
} NAME(inertia); /* entries of the inertia matrix, kg m^2 */

static inline NAME(turns) NAME(turns_of)(const T q[3])
{
    NAME(turns) at;
    at.ca = COSINE(q[0]);
    at.sa = SINE(q[0]);
    at.cb = COSINE(q[1]);
    at.sb = SINE(q[1]);
    at.cg = COSINE(q[2]);
    at.sg = SINE(q[2]);
    return at;
}

/* Torque on the hinges (N m) of a torque on the rotor in frame S: E^T torque_S. */
static inline void NAME(generalised_torque)(const T q[3], const T torque_S[3], T torque_q[3])
{
    const NAME(turns) at = NAME(turns_of)(q);
    torque_q[0] = torque_S[0];
    torque_q[1] = at.ca * torque_S[1] + at.sa * torque_S[2];
    torque_q[2] = at.sb * torque_S[0] + at.cb * (at.ca * torque_S[2] - at.sa * torque_S[1]);
}

/* Inertia matrix about the principal axes J, kg m^2. */
static inline NAME(inertia) NAME(inertia_of)(const NAME(turns) *at, const ST_NUMBER J[3])
{
    NAME(inertia) M;
    const T cg_2 = at->cg * at->cg, sg_2 = at->sg * at->sg;
    M.alpha = (J[0] * cg_2 + J[1] * sg_2) * (at->cb * at->cb) + J[2] * (at->sb * at->sb);
    M.beta = J[0] * sg_2 + J[1] * cg_2;
    M.gamma = J[2];
    M.alpha_beta = (J[0] - J[1]) * at->cb * at->cg * at->sg;
    M.alpha_gamma = J[2] * at->sb;
    M.beta_gamma = 0;
    return M;
}

/* Coriolis and centrifugal torque C qdot on the hinges, N m: rows of C in Christoffel form. */
static inline void NAME(coriolis)(const NAME(turns) *at, const T v[3], const ST_NUMBER J[3], T C[3][3])
{
    const T cb = at->cb, sb = at->sb, cg = at->cg, sg = at->sg;
    const ST_NUMBER D = J[0] - J[1];
    const T D_double = D * cb * (cg * cg - sg * sg);
    const T tilt = (J[2] - J[0] * (cg * cg) - J[1] * (sg * sg)) * sb * cb;
    const T sum_half = (D_double + J[2] * cb) / 2;
    const T difference_half = (D_double - J[2] * cb) / 2;
    C[0][0] = tilt * v[1] - D * (cb * cb) * sg * cg * v[2];
    C[0][1] = tilt * v[0] - D * sb * sg * cg * v[1] + sum_half * v[2];
    C[0][2] = -D * (cb * cb) * sg * cg * v[0] + sum_half * v[1];
    C[1][0] = -tilt * v[0] + difference_half * v[2];
    C[1][1] = D * sg * cg * v[2];
    C[1][2] = difference_half * v[0] + D * sg * cg * v[1];
    C[2][0] = D * (cb * cb) * sg * cg * v[0] - difference_half * v[1];
    C[2][1] = -difference_half * v[0] - D * sg * cg * v[1];
    C[2][2] = 0;
}

/* Solution x of M x = torque; M may be the sum of an inertia matrix and a diagonal one. */
static inline void NAME(solve_inertia)(const NAME(inertia) *M, const T torque[3], T x[3])
{
#if ST_GENERAL_JOINT
    const T from_alpha = M->alpha_gamma / M->gamma, from_beta = M->beta_gamma / M->gamma;
    const T coupling = M->alpha_beta - from_alpha * M->beta_gamma;
    const T b = M->beta - from_beta * M->beta_gamma;
    const T on_beta = torque[1] - from_beta * torque[2], share = coupling / b;
    const T left = M->alpha - from_alpha * M->alpha_gamma - share * coupling;
    x[0] = (torque[0] - from_alpha * torque[2] - share * on_beta) / left;
    x[1] = on_beta / b - share * x[0];
    x[2] = torque[2] / M->gamma - from_alpha * x[0] - from_beta * x[1];
#else
    const T to_beta = M->alpha_beta / M->beta, to_gamma = M->alpha_gamma / M->gamma;
    const T left = M->alpha - to_beta * M->alpha_beta - to_gamma * M->alpha_gamma;
    x[0] = (torque[0] - to_beta * torque[1] - to_gamma * torque[2]) / left;
    x[1] = torque[1] / M->beta - to_beta * x[0];
    x[2] = torque[2] / M->gamma - to_gamma * x[0];
#endif
}

#if !ST_GENERAL_JOINT
/* Accelerations of the hinges, rad/s^2, under a torque on them; weight is m g l of a payload, N m. */
static inline void NAME(accelerate)(
    const ST_NUMBER J[3], ST_NUMBER weight, const T q[3], const T v[3], const T torque[3], T acceleration[3])
{
    const NAME(turns) at = NAME(turns_of)(q);
    const NAME(inertia) M = NAME(inertia_of)(&at, J);
    T C[3][3], net[3], gravity[3];
    int i;
    NAME(coriolis)(&at, v, J, C);
    gravity[0] = -weight * at.sa * at.cb;
    gravity[1] = -weight * at.ca * at.sb;
    gravity[2] = 0;
    for (i = 0; i < 3; i++) {
        net[i] = torque[i] - C[i][0] * v[0] - C[i][1] * v[1] - C[i][2] * v[2] - gravity[i];
    }
    NAME(solve_inertia)(&M, net, acceleration);
}
#endif

/* Torque matrix at a pose, N m/A: column j is the torque of one ampere in group j, in frame S.
 *
 * h(cos phi) = (f_t(phi) - f_t(pi - phi)) / sin(phi) is looked up as a cubic in cos phi. */
static inline void NAME(torque_matrix)(const T q[3], T G[3][ST_GROUPS])
{
    const NAME(turns) at = NAME(turns_of)(q);
    T R[3][3];
    int i, j, line;
    R[0][0] = at.cb * at.cg;
    R[0][1] = -at.cb * at.sg;
    R[0][2] = at.sb;
    R[1][0] = at.ca * at.sg + at.sa * at.sb * at.cg;
    R[1][1] = at.ca * at.cg - at.sa * at.sb * at.sg;
    R[1][2] = -at.sa * at.cb;
    R[2][0] = at.sa * at.sg - at.ca * at.sb * at.cg;
    R[2][1] = at.sa * at.cg + at.ca * at.sb * at.sg;
    R[2][2] = at.ca * at.cb;
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
