/* SPDX-License-Identifier: MIT */
/* General joint: three hinges in series with any axes, and three bodies of four point masses each.
 *
 * Included after st_equations.h for the same type T. Every vector is given in frame S at the pose 0. The model
 * header defines ST_HINGE_AXES, ST_HINGE_POINTS [3][3], ST_MASSES [3][4][4] (x, y, z in m, mass in kg) and
 * ST_GRAVITY [3] in m/s^2.
 */

typedef struct {
    T axes[3][3], origin[3];
} NAME(frame);

typedef struct {
    NAME(frame) body[3];
    T hinge[3][3], point[3][3]; /* axes of the hinges, and a point of each */
} NAME(chain);

static inline T NAME(dot)(const T a[3], const T b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void NAME(cross)(const T a[3], const T b[3], T product[3])
{
    product[0] = a[1] * b[2] - a[2] * b[1];
    product[1] = a[2] * b[0] - a[0] * b[2];
    product[2] = a[0] * b[1] - a[1] * b[0];
}

/* Position in frame S of a point that is fixed to a body. */
static inline void NAME(place)(const NAME(frame) *frame, const double y[3], T x[3])
{
    int i;
    for (i = 0; i < 3; i++) {
        x[i] = frame->origin[i]
            + (frame->axes[0][i] * y[0] + (frame->axes[1][i] * y[1] + frame->axes[2][i] * y[2]));
    }
}

/* Rotate a vector about a unit vector (Rodrigues). */
static inline void NAME(rotate)(const T v[3], const T e[3], T c, T s, T rotated[3])
{
    T product[3];
    const T along = (1 - c) * NAME(dot)(e, v);
    int i;
    NAME(cross)(e, v, product);
    for (i = 0; i < 3; i++) {
        rotated[i] = v[i] * c + product[i] * s + e[i] * along;
    }
}

static inline void NAME(chain_at)(const T q[3], NAME(chain) *chain)
{
    NAME(frame) frame;
    int hinge, i, k;
    for (i = 0; i < 3; i++) {
        for (k = 0; k < 3; k++) {
            frame.axes[i][k] = i == k;
        }
        frame.origin[i] = 0;
    }
    for (hinge = 0; hinge < 3; hinge++) {
        const T c = COSINE(q[hinge]), s = SINE(q[hinge]);
        T *e = chain->hinge[hinge], *p = chain->point[hinge], arm[3];
        NAME(frame) *body = &chain->body[hinge];
        NAME(place)(&frame, ST_HINGE_POINTS[hinge], p);
        NAME(place)(&frame, ST_HINGE_AXES[hinge], e);
        for (i = 0; i < 3; i++) {
            e[i] -= frame.origin[i];
            arm[i] = frame.origin[i] - p[i];
        }
        for (k = 0; k < 3; k++) {
            NAME(rotate)(frame.axes[k], e, c, s, body->axes[k]);
        }
        NAME(rotate)(arm, e, c, s, body->origin);
        for (i = 0; i < 3; i++) {
            body->origin[i] += p[i];
        }
        frame = *body;
    }
}

/* Acceleration at x of a body whose point at the origin has the acceleration a. */
static inline void NAME(acceleration_of)(const T w[3], const T w_rate[3], const T a[3], const T x[3], T result[3])
{
    T tangential[3], swept[3], centripetal[3];
    int i;
    NAME(cross)(w_rate, x, tangential);
    NAME(cross)(w, x, swept);
    NAME(cross)(w, swept, centripetal);
    for (i = 0; i < 3; i++) {
        result[i] = a[i] + (tangential[i] + centripetal[i]);
    }
}

/* Inertia matrix, and the torque on the hinges that holds the rates: Coriolis, centrifugal, gravity. */
static inline void NAME(chain_equations)(const T q[3], const T v[3], NAME(inertia) *M, T bias[3])
{
    NAME(chain) at;
    T w[3] = {0, 0, 0}, w_rate[3] = {0, 0, 0}, a[3], entries[3][3], zero[3] = {0, 0, 0};
    int body, i, j, k;
    NAME(chain_at)(q, &at);
    for (i = 0; i < 3; i++) {
        a[i] = -ST_GRAVITY[i];
        bias[i] = 0;
        for (j = 0; j < 3; j++) {
            entries[i][j] = 0;
        }
    }
    for (body = 0; body < 3; body++) {
        const T *p = at.point[body];
        T at_hinge[3], own[3], turned[3];
        NAME(acceleration_of)(w, w_rate, a, p, at_hinge);
        for (i = 0; i < 3; i++) {
            own[i] = at.hinge[body][i] * v[body];
        }
        NAME(cross)(w, own, turned);
        for (i = 0; i < 3; i++) {
            w_rate[i] += turned[i];
            w[i] += own[i];
        }
        NAME(acceleration_of)(w, w_rate, zero, p, turned);
        for (i = 0; i < 3; i++) {
            a[i] = at_hinge[i] - turned[i];
        }
        for (k = 0; k < 4; k++) {
            const double *mass = ST_MASSES[body][k];
            T x[3], force[3], J[3][3];
            NAME(place)(&at.body[body], mass, x);
            NAME(acceleration_of)(w, w_rate, a, x, force);
            for (i = 0; i <= body; i++) {
                T arm[3];
                for (j = 0; j < 3; j++) {
                    arm[j] = x[j] - at.point[i][j];
                }
                NAME(cross)(at.hinge[i], arm, J[i]);
                bias[i] += mass[3] * NAME(dot)(J[i], force);
                for (j = 0; j <= i; j++) {
                    entries[j][i] += mass[3] * NAME(dot)(J[j], J[i]);
                }
            }
        }
    }
    M->alpha = entries[0][0];
    M->beta = entries[1][1];
    M->gamma = entries[2][2];
    M->alpha_beta = entries[0][1];
    M->alpha_gamma = entries[0][2];
    M->beta_gamma = entries[1][2];
}

/* Angles of ideal hinges with the orientation of the joint, and their rates. */
static inline void NAME(ideal_motion)(const T q[3], const T v[3], T ideal_q[3], T ideal_v[3])
{
    NAME(chain) chain;
    NAME(turns) at;
    T w[3];
    int i;
    NAME(chain_at)(q, &chain);
    {
        const T *X = chain.body[2].axes[0], *Y = chain.body[2].axes[1], *Z = chain.body[2].axes[2];
        ideal_q[0] = ARC_TANGENT(-Z[1], Z[2]);
        ideal_q[1] = ARC_SINE(Z[0]);
        ideal_q[2] = ARC_TANGENT(-Y[0], X[0]);
    }
    at = NAME(turns_of)(ideal_q);
    for (i = 0; i < 3; i++) {
        w[i] = chain.hinge[0][i] * v[0] + (chain.hinge[1][i] * v[1] + chain.hinge[2][i] * v[2]);
    }
    ideal_v[2] = (at.ca * w[2] - at.sa * w[1]) / at.cb;
    ideal_v[1] = at.ca * w[1] + at.sa * w[2];
    ideal_v[0] = w[0] - at.sb * ideal_v[2];
}
