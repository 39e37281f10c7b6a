/* SPDX-License-Identifier: MIT */
/* Control tick: estimator, governor, law, feed-forward, allocation, estimate of the applied torque. */
#include "st_controller.h"

#include "st_numbers.h"

#define ST_NUMBER st_real
#include "st_controller_tables.h" /* generated */

#define ST_MOTION "st_controller_motion.h"
#define T st_real
#define NAME(x) st_##x
#define RE(x) (x)
#define SINE st_sin
#define COSINE st_cos
#include "st_equations.h"

/* 1 if an angle changed further in a period than a rotor turns: an estimator then keeps its rate. */
static inline int st_jumped(st_real change, st_real period)
{
    return st_fabs(change) > st_greatest((st_real)0.2, 200 * period);
}

#include ST_ESTIMATOR
#include ST_LAW
#include ST_ALLOCATION
#if ST_GOVERNOR
#include "st_governor.h"
#endif
#if ST_FEED_FORWARD
#include "st_feed_forward.h"
#endif

void st_controller_start(st_controller *controller)
{
    int i;
#if ST_APPLIED_TORQUE || ST_FEED_FORWARD || ST_GOVERNOR
    int j;
#endif
    for (i = 0; i < ST_LAW_STATE; i++) {
        controller->law[i] = ST_LAW_START[i];
    }
    for (i = 0; i < ST_ESTIMATOR_STATE; i++) {
        controller->estimator[i] = 0;
    }
    for (i = 0; i < 3; i++) {
        controller->applied_torque[i] = 0;
    }
#if ST_APPLIED_TORQUE
    for (j = 0; j < ST_GROUPS; j++) {
        controller->current[j] = 0;
        for (i = 0; i < ST_COMMANDS; i++) {
            controller->commands[i][j] = 0;
        }
    }
#endif
#if ST_GOVERNOR
    controller->governed_started = 0;
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++) {
            controller->governed[i][j] = 0;
        }
    }
#endif
#if ST_FEED_FORWARD
    for (i = 0; i < ST_FED_FORWARD; i++) {
        for (j = 0; j < 3; j++) {
            controller->fed_forward[i][j] = 0;
        }
    }
#endif
}

#if ST_APPLIED_TORQUE
/* Advance the estimate of currents and torque by a period, from the commands after the nominal delay. */
static void st_estimate_torque(
    st_controller *controller, const st_real q[3], st_real G[3][ST_GROUPS], const st_real command[ST_GROUPS])
{
    const st_real f = ST_FRACTION;
    st_real torque_S[3] = {0, 0, 0};
    int i, j;
    for (j = 0; j < ST_GROUPS; j++) {
        st_real older, newer, distance, first, mean;
        for (i = ST_COMMANDS - 1; i > 0; i--) {
            controller->commands[i][j] = controller->commands[i - 1][j];
        }
        controller->commands[0][j] = command[j];
        older = controller->commands[ST_COMMANDS - 1][j];
        newer = controller->commands[ST_COMMANDS - 2][j];
        distance = controller->current[j] - older;
        first = older + ST_OLDER_MEAN[j] * distance;
        distance = older + ST_OLDER_DECAY[j] * distance - newer;
        mean = f * first + (1 - f) * (newer + ST_NEWER_MEAN[j] * distance);
        controller->current[j] = newer + ST_NEWER_DECAY[j] * distance;
        for (i = 0; i < 3; i++) {
            torque_S[i] += G[i][j] * mean;
        }
    }
    st_generalised_torque(q, torque_S, controller->applied_torque);
}
#endif

/* Torque of the law with its compensators. */
static void st_call_law(st_controller *controller, st_real reference[3][3], st_real measurement[3][3],
    st_real torque[3])
{
#if ST_FEED_FORWARD
    st_real fed[3];
    int i;
#endif
#if ST_GOVERNOR
    st_govern(controller, measurement, reference);
#endif
#if ST_FEED_FORWARD
    st_feed_forward(controller, reference, measurement[2], fed);
#endif
    st_law((const st_real(*)[3])reference, (const st_real(*)[3])measurement, controller->law, torque);
#if ST_FEED_FORWARD
    for (i = 0; i < 3; i++) {
        torque[i] += fed[i];
    }
#endif
}

/* 1 if all inputs are within their bounds, which none that is not finite is. */
static int st_acceptable(const st_real reference[3][3], const st_real angle[3], const st_real rate[3])
{
    int i;
    (void)rate;
    for (i = 0; i < 3; i++) {
        const st_real *bounds = ST_ANGLE_BOUNDS[i], desired = reference[0][i];
        if (!(bounds[0] <= angle[i] && angle[i] <= bounds[1] && bounds[0] <= desired && desired <= bounds[1]
                && st_fabs(angle[i] - desired) <= ST_LARGEST_ERROR && st_fabs(reference[1][i]) <= ST_LARGEST_RATE
                && st_fabs(reference[2][i]) <= ST_LARGEST_ACCELERATION)) {
            return 0;
        }
#if !ST_ESTIMATOR_STATE
        if (!(st_fabs(rate[i]) <= ST_LARGEST_RATE)) {
            return 0;
        }
#endif
    }
    return 1;
}

static int st_all_finite(const st_real *values, int count)
{
    int i;
    for (i = 0; i < count; i++) {
        if (!st_finite(values[i])) {
            return 0;
        }
    }
    return 1;
}

/* 1 if state, torque and commands are finite. */
static int st_sound(const st_controller *controller, const st_real torque[3], const st_real command[ST_GROUPS])
{
    int sound = st_all_finite(controller->law, ST_LAW_STATE) && st_all_finite(torque, 3)
        && st_all_finite(controller->estimator, ST_ESTIMATOR_STATE) && st_all_finite(command, ST_GROUPS)
        && st_all_finite(controller->applied_torque, 3);
#if ST_APPLIED_TORQUE
    sound = sound && st_all_finite(controller->current, ST_GROUPS);
#endif
#if ST_GOVERNOR
    sound = sound && st_all_finite(controller->governed[0], 9);
#endif
#if ST_FEED_FORWARD
    sound = sound && st_all_finite(controller->fed_forward[0], 3);
#endif
    return sound;
}

/* Tick of accepted inputs; returns the share of the torque. */
static st_real st_run(st_controller *controller, const st_real reference[3][3], const st_real angle[3],
    const st_real rate[3], st_real torque[3], st_real command[ST_GROUPS])
{
    st_real desired[3][3], measurement[3][3], pose[3], torque_S[3], G[3][ST_GROUPS], share;
    int i, j;
    for (i = 0; i < 3; i++) {
        measurement[0][i] = angle[i];
        for (j = 0; j < 3; j++) {
            desired[i][j] = reference[i][j];
        }
    }
    st_estimate_rates(measurement[0], rate, controller->estimator, measurement[1]);
    for (i = 0; i < 3; i++) {
        pose[i] = measurement[0][i];
        measurement[2][i] = controller->applied_torque[i];
    }
    st_torque_matrix(pose, G);
    st_call_law(controller, desired, measurement, torque);
    st_cartesian_torque(pose, torque, torque_S);
    share = st_allocate(G, torque_S, ST_CURRENT_LIMIT_A, command);
#if ST_APPLIED_TORQUE
    st_estimate_torque(controller, pose, G, command);
#endif
    return share;
}

st_real st_controller_tick(st_controller *controller, const st_real reference[3][3], const st_real angle[3],
    const st_real rate[3], st_real command[ST_GROUPS])
{
    const st_controller before = *controller;
    st_real torque[3];
    int j;
    if (st_acceptable(reference, angle, rate)) {
        const st_real share = st_run(controller, reference, angle, rate, torque, command);
        if (st_sound(controller, torque, command)) {
            return share;
        }
        *controller = before;
    }
    for (j = 0; j < ST_GROUPS; j++) {
        command[j] = 0;
    }
    return -1;
}
