/* SPDX-License-Identifier: MIT */
/* Sliding mode with an extended state observer. */
#include "st_command_history.h"
#include "st_fuzzy.h"

enum {
    ST_INERTIA = 0, ST_SLOPE = 3, ST_REACHING = 6, ST_BOOST_SLOPE = 9, ST_LAYER = 12, ST_BOOST_BOUND = 15,
    ST_BANDWIDTH = 18, ST_SLOW = 21, ST_FAST = 24, ST_FUZZY_RATE = 27, ST_PERIOD = 30, ST_FADE = 31,
    ST_SHARE = 32, ST_COUPLED = 33, ST_DEAD_ZONE = 34, ST_LEAKAGE = 35, ST_FUZZY_BOUND = 36
};
enum {
    ST_SLIDING = 0, ST_OBSERVED = 3, ST_BOOST = 6, ST_ACTIVE = 9, ST_FUZZY = 12, ST_ANGLE = 15, ST_RATE = 18,
    ST_STARTED = 21, ST_THETA = 22, ST_HISTORY = 22 + 3 * ST_CONSEQUENTS,
    ST_HISTORY_ROWS = (ST_LAW_STATE - ST_HISTORY) / 3
};

static const st_real st_rest[3] = {0, 0, 0};

/* Pose or rates for the nominal model; without coupling those of the upright rotor at rest. */
static const st_real *st_operating(const st_real motion[3])
{
    return ST_LAW_PARAMETERS[ST_COUPLED] != 0 ? motion : st_rest;
}

/* Advance a motion by a time under a constant torque, with the initial acceleration. */
static void st_advance_motion(st_real q[3], st_real v[3], const st_real torque[3], st_real time_s)
{
    const st_real half = time_s * time_s / 2;
    st_real acceleration[3];
    int i;
    st_acceleration(ST_LAW_PARAMETERS + ST_INERTIA, st_operating(q), st_operating(v), torque, acceleration);
    for (i = 0; i < 3; i++) {
        q[i] = q[i] + time_s * v[i] + half * acceleration[i];
        v[i] = v[i] + time_s * acceleration[i];
    }
}

/* Update the observer with the measured angles; at the first tick, with the rates too. */
static void st_observe(const st_real measurement[3][3], st_real *state)
{
    const st_real *parameters = ST_LAW_PARAMETERS;
    const st_real period = parameters[ST_PERIOD];
    st_real torque[3], innovation[3], unexplained[3], learnt[3];
    st_real *q = state + ST_ANGLE, *v = state + ST_RATE;
    int i;
    if (!(state[ST_STARTED] != 0)) {
        state[ST_STARTED] = 1;
        for (i = 0; i < 3; i++) {
            q[i] = measurement[0][i];
            v[i] = measurement[1][i];
            state[ST_ACTIVE + i] = parameters[ST_SLOW + i];
        }
        return;
    }
    for (i = 0; i < 3; i++) {
        torque[i] = measurement[2][i] + state[ST_OBSERVED + i];
    }
    st_advance_motion(q, v, torque, period);
    for (i = 0; i < 3; i++) {
        const st_real a = st_exp(-parameters[ST_BANDWIDTH + i] * period);
        const st_real b = st_exp(-state[ST_ACTIVE + i] * period);
        const st_real of_angle = 1 - a * a * b;
        const st_real of_acceleration = (1 - a) * (1 - a) * (1 - b) / (period * period);
        const st_real of_rate
            = (3 - 2 * a - b - of_angle - of_acceleration * (period * period) / 2) / period;
        innovation[i] = measurement[0][i] - q[i];
        q[i] = q[i] + of_angle * innovation[i];
        v[i] = v[i] + of_rate * innovation[i];
        unexplained[i] = of_acceleration * innovation[i];
    }
    st_motion_torque(parameters + ST_INERTIA, st_operating(q), st_rest, unexplained, learnt);
    for (i = 0; i < 3; i++) {
        state[ST_OBSERVED + i] += learnt[i];
    }
}

/* Motion at the end of the nominal delay, under the pending commands. */
static void st_motion_ahead(const st_real *state, st_real q[3], st_real v[3])
{
    const st_real *parameters = ST_LAW_PARAMETERS;
    const int whole = ST_HISTORY_ROWS - 2;
    int row, i;
    for (i = 0; i < 3; i++) {
        q[i] = state[ST_ANGLE + i];
        v[i] = state[ST_RATE + i];
    }
    for (row = whole; row >= 0; row--) {
        const st_real time_s = row == whole ? parameters[ST_SHARE] * parameters[ST_PERIOD] : parameters[ST_PERIOD];
        if (time_s > 0) {
            const st_real *command = state + ST_HISTORY + 3 * row;
            st_real total[3];
            for (i = 0; i < 3; i++) {
                total[i] = command[i] + state[ST_OBSERVED + i];
            }
            st_advance_motion(q, v, total, time_s);
        }
    }
}

/* 1 if the applied torque was close to the commanded one, so that s is caused by the rotor. */
static int st_torque_follows(const st_real measurement[3][3], const st_real *state)
{
    st_real commanded = 0, missing = 0;
    int i;
    for (i = 0; i < 3; i++) {
        const st_real command
            = st_delayed_command(state + ST_HISTORY, ST_HISTORY_ROWS, i, ST_LAW_PARAMETERS[ST_SHARE]);
        commanded += st_fabs(command);
        missing += st_fabs(command - measurement[2][i]);
    }
    return missing <= commanded / 5;
}

/* Output of the fuzzy approximator of an axis, with bounded adaptation. */
static st_real st_fuzzy_acceleration(int axis, st_real angle, st_real rate, st_real s, st_real *state)
{
    const st_real *parameters = ST_LAW_PARAMETERS;
    const st_real adaptation = parameters[ST_FUZZY_RATE + axis];
    st_real *theta = state + ST_THETA + ST_CONSEQUENTS * axis;
    st_real output, norm, factor, squares = 0;
    int k;
    if (!(adaptation != 0)) {
        return 0;
    }
    s = st_fabs(s) > parameters[ST_DEAD_ZONE] ? s : 0;
    output = st_approximate(rate, angle, -adaptation * s * parameters[ST_PERIOD], theta);
    for (k = 0; k < ST_CONSEQUENTS; k++) {
        squares += theta[k] * theta[k];
    }
    factor = st_greatest(0, 1 - parameters[ST_LEAKAGE] * parameters[ST_PERIOD]);
    norm = factor * st_sqrt(squares);
    if (norm > parameters[ST_FUZZY_BOUND]) {
        factor *= parameters[ST_FUZZY_BOUND] / norm;
    }
    for (k = 0; k < ST_CONSEQUENTS; k++) {
        theta[k] *= factor;
    }
    return output;
}

/* Acceleration of an axis for the reference at the time at which the torque acts. */
static st_real st_desired_acceleration(
    int axis, st_real angle, st_real rate, int adapts, const st_real reference[3][3], st_real *state)
{
    const st_real *parameters = ST_LAW_PARAMETERS;
    const st_real ahead_s = (ST_HISTORY_ROWS - 2 + parameters[ST_SHARE]) * parameters[ST_PERIOD];
    const st_real acceleration = reference[2][axis];
    const st_real desired_rate = reference[1][axis] + ahead_s * acceleration;
    const st_real desired = reference[0][axis] + ahead_s * (reference[1][axis] + ahead_s * acceleration / 2);
    const st_real slope = parameters[ST_SLOPE + axis], layer = parameters[ST_LAYER + axis];
    const st_real s = slope * (angle - desired) + (rate - desired_rate);
    const st_real boost = st_within(
        parameters[ST_BOOST_SLOPE + axis] * (s - st_within(s, layer)), parameters[ST_BOOST_BOUND + axis]);
    const st_real slow = parameters[ST_SLOW + axis];
    const st_real faded = slow + parameters[ST_FADE] * (state[ST_ACTIVE + axis] - slow);
    st_real fuzzy;
    state[ST_ACTIVE + axis] = st_fabs(s) > layer ? parameters[ST_FAST + axis] : faded;
    state[ST_SLIDING + axis] = s;
    state[ST_BOOST + axis] = boost;
    fuzzy = st_fuzzy_acceleration(axis, angle, rate, adapts ? s : 0, state);
    state[ST_FUZZY + axis] = parameters[ST_INERTIA + axis] * fuzzy;
    return acceleration - slope * (rate - desired_rate) - parameters[ST_REACHING + axis] * s - boost + fuzzy;
}

static void st_law(
    const st_real reference[3][3], const st_real measurement[3][3], st_real *state, st_real torque[3])
{
    st_real q[3], v[3], acceleration[3];
    int adapts, i;
    st_observe(measurement, state);
    st_motion_ahead(state, q, v);
    adapts = st_torque_follows(measurement, state);
    for (i = 0; i < 3; i++) {
        acceleration[i] = st_desired_acceleration(i, q[i], v[i], adapts, reference, state);
    }
    st_motion_torque(ST_LAW_PARAMETERS + ST_INERTIA, st_operating(q), st_operating(v), acceleration, torque);
    for (i = 0; i < 3; i++) {
        torque[i] -= state[ST_OBSERVED + i];
    }
    st_store_command(state + ST_HISTORY, ST_HISTORY_ROWS, torque);
}
