/* SPDX-License-Identifier: MIT */
/* Plant: equations of motion, currents, temperatures, and their fixed-step integration. */
#include "st_plant.h"

#include <complex.h>
#include <math.h>

#define ST_NUMBER double
#define ST_MOTION "st_plant_motion.h"
#include "st_plant_bounds.h" /* generated */
#include "st_plant_tables.h"

#define RE(x) NAME(real)(x)
#define SINE NAME(sine)
#define COSINE NAME(cosine)
#define ROOT NAME(root)
#define ARC_SINE NAME(arc_sine)
#define ARC_TANGENT NAME(arc_tangent)

/* Real numbers. */
#define T double
#define NAME(x) st_##x
#define st_real(x) (x)
#define st_sine sin
#define st_cosine cos
#define st_root sqrt
#define st_arc_sine asin
#define st_arc_tangent atan2
#include "st_equations.h"
#include "st_rates.h"
#undef T
#undef NAME

/* Complex numbers: friction needs products; as dual numbers, with a tiny imaginary part, they carry a
 * derivative through the same formulas without a difference of near values. */
typedef double complex st_complex;
#define T st_complex
#define NAME(x) st_##x##_complex
#define st_real_complex creal
static st_complex st_dual(double value, double slope)
{
    return value + slope * _Complex_I;
}
static st_complex st_sine_complex(st_complex x)
{
    return st_dual(sin(creal(x)), cos(creal(x)) * cimag(x));
}
static st_complex st_cosine_complex(st_complex x)
{
    return st_dual(cos(creal(x)), -sin(creal(x)) * cimag(x));
}
static st_complex st_root_complex(st_complex x)
{
    const double root = sqrt(creal(x));
    return st_dual(root, cimag(x) / (2 * root));
}
#if ST_GENERAL_JOINT
static st_complex st_arc_sine_complex(st_complex x)
{
    return st_dual(asin(creal(x)), cimag(x) / sqrt(1 - creal(x) * creal(x)));
}
static st_complex st_arc_tangent_complex(st_complex y, st_complex x)
{
    const double a = creal(x), b = creal(y);
    return st_dual(atan2(b, a), (a * cimag(y) - b * cimag(x)) / (a * a + b * b));
}
#endif
#include "st_equations.h"
#include "st_rates.h"

/* Imaginary parts are directions times this: their products vanish, and no direction underflows. */
#define ST_TINY 1e-100

/* Directions above it are scaled: products with their imaginary parts vanish then, too. */
#define ST_LONG 1e15

/* Below, series; above, differences lose only their last digits. */
#define ST_SERIES_TO 0.25
#define ST_TERMS 14

/* Shares of the start value (a) and the final value (b) in a relaxation: see st_relaxation. */
typedef struct {
    double settled, mean, start_start, start_settled, settled_settled;
} st_shares;

/* ST_OK if all numbers are within their bounds, which none that is not finite is. */
static int st_check(const double *values, const double (*bounds)[2], int count)
{
    int i;
    for (i = 0; i < count; i++) {
        if (!(bounds[i][0] <= values[i] && values[i] <= bounds[i][1])) {
            return ST_INVALID;
        }
    }
    return ST_OK;
}

/* Largest magnitude; -1 if a number is not finite. */
static double st_magnitude(const double *values, int count)
{
    double largest = 0;
    int i;
    for (i = 0; i < count; i++) {
        if (!(fabs(values[i]) < HUGE_VAL)) {
            return -1;
        }
        largest = fmax(largest, fabs(values[i]));
    }
    return largest;
}

static int st_check_motion(const st_parameters *p, const double *input, const double *x)
{
    return st_check((const double *)p, ST_PARAMETER_BOUNDS, (int)(sizeof *p / sizeof(double)))
        || st_check(input, ST_INPUT_BOUNDS, ST_INPUTS) || st_check(x, ST_STATE_BOUNDS, ST_STATES) ? ST_INVALID : ST_OK;
}

int st_plant_check(const st_parameters *p, const double *input, const st_plant *plant)
{
    const double heat_s = plant->heat_s;
    return st_check_motion(p, input, plant->x) || st_check(plant->last_qdot, ST_STATE_BOUNDS + ST_QDOT, 3)
        || st_magnitude(plant->copper_J, ST_GROUPS) < 0 || !(heat_s >= 0 && heat_s < HUGE_VAL) ? ST_INVALID : ST_OK;
}

/* Copy a result if all its numbers are finite. */
static int st_give(const double values[ST_STATES], double *result)
{
    int i;
    if (st_magnitude(values, ST_STATES) < 0) {
        return ST_DIVERGED;
    }
    for (i = 0; i < ST_STATES; i++) {
        result[i] = values[i];
    }
    return ST_OK;
}

int st_plant_derivatives(const st_parameters *p, const double *input, const double *x, double *derivatives)
{
    double values[ST_STATES];
    if (st_check_motion(p, input, x)) {
        return ST_INVALID;
    }
    st_rates(p, input, x, values);
    return st_give(values, derivatives);
}

int st_plant_directional(const st_parameters *p, const double *input, const double *x,
    const double *input_direction, const double *x_direction, double *result)
{
    st_complex dual_input[ST_INPUTS], dual_x[ST_STATES], derivatives[ST_STATES];
    const double of_input = st_magnitude(input_direction, ST_INPUTS), of_x = st_magnitude(x_direction, ST_STATES);
    const double length = fmax(of_input, of_x), scale = length > ST_LONG ? length : 1;
    double values[ST_STATES];
    int i;
    if (st_check_motion(p, input, x) || of_input < 0 || of_x < 0) {
        return ST_INVALID;
    }
    for (i = 0; i < ST_INPUTS; i++) {
        dual_input[i] = st_dual(input[i], ST_TINY * (input_direction[i] / scale));
    }
    for (i = 0; i < ST_STATES; i++) {
        dual_x[i] = st_dual(x[i], ST_TINY * (x_direction[i] / scale));
    }
    st_rates_complex(p, dual_input, dual_x, derivatives);
    for (i = 0; i < ST_STATES; i++) {
        values[i] = cimag(derivatives[i]) / ST_TINY * scale;
    }
    return st_give(values, result);
}

void st_plant_defaults(st_parameters *parameters, double *x)
{
    int i;
    *parameters = ST_DEFAULTS;
    for (i = 0; i < ST_STATES; i++) {
        x[i] = ST_INITIAL[i];
    }
}

int st_plant_start(st_plant *plant, const double *x)
{
    int i;
    for (i = 0; i < ST_STATES; i++) {
        plant->x[i] = x[i];
    }
    for (i = 0; i < 3; i++) {
        plant->last_qdot[i] = x[ST_QDOT + i];
    }
    for (i = 0; i < ST_GROUPS; i++) {
        plant->copper_J[i] = 0;
    }
    plant->heat_s = 0;
    return st_check(x, ST_STATE_BOUNDS, ST_STATES);
}

/* Shares for a time of x time constants: 1 - exp(-x), its mean, and the means of the products of exp(-s) and
 * 1 - exp(-s). */
static st_shares st_relaxation(double x)
{
    static const double factorials[ST_TERMS + 2] = {1, 1, 2, 6, 24, 120, 720, 5040, 40320, 362880, 3628800,
        39916800, 479001600, 6227020800, 87178291200, 1307674368000};
    st_shares shares;
    double remaining;
    if (x < ST_SERIES_TO) {
        double power = 1 << ST_TERMS;
        int n;
        shares.mean = shares.settled_settled = 0;
        for (n = ST_TERMS; n > 0; n--) {
            shares.mean = 1 / factorials[n + 1] - x * shares.mean;
            shares.settled_settled = (power - 2) / factorials[n + 1] - x * shares.settled_settled;
            power /= 2;
        }
        shares.mean *= x;
        shares.settled_settled *= -x;
        remaining = 1 - shares.mean;
        shares.settled = x * remaining;
    } else {
        shares.settled = -expm1(-x);
        remaining = shares.settled / x;
        shares.mean = (x - shares.settled) / x;
        shares.settled_settled = (x - shares.settled - shares.settled * shares.settled / 2) / x;
    }
    shares.start_start = remaining * (2 - shares.settled) / 2;
    shares.start_settled = remaining * shares.settled / 2;
    return shares;
}

/* Shares for a duration and a time constant, which may be 0. */
static st_shares st_relaxed(double duration_s, double time_constant_s)
{
    static const st_shares settled = {1, 1, 0, 0, 1};
    return time_constant_s > 0 ? st_relaxation(duration_s / time_constant_s) : settled;
}

/* Advance the rates by a time under friction alone: (1 + X + X^2/2)^-1 with X = time M^-1 diag(k), where k are
 * the friction factors at the rates in the middle. It neither amplifies nor reverses a motion. */
static void st_slow_down(const st_parameters *p, double time_s, const double q[3], double v[3])
{
    const st_complex pole = st_dual(0.5, 0.5), residue = st_dual(1, -1);
    st_inertia M, damped;
    st_inertia_complex damped_complex;
    double before[3], middle[3];
    st_complex before_complex[3], slowed[3];
    int i;
    st_mass_matrix(p, q, &M);
    before[0] = M.alpha * v[0] + M.alpha_beta * v[1] + M.alpha_gamma * v[2];
    before[1] = M.alpha_beta * v[0] + M.beta * v[1] + M.beta_gamma * v[2];
    before[2] = M.alpha_gamma * v[0] + M.beta_gamma * v[1] + M.gamma * v[2];
    damped = M;
    damped.alpha += time_s / 2 * st_friction_factor(p, 0, v[0]);
    damped.beta += time_s / 2 * st_friction_factor(p, 1, v[1]);
    damped.gamma += time_s / 2 * st_friction_factor(p, 2, v[2]);
    st_solve_inertia(&damped, before, middle);
    damped_complex.alpha = M.alpha + pole * time_s * st_friction_factor(p, 0, middle[0]);
    damped_complex.beta = M.beta + pole * time_s * st_friction_factor(p, 1, middle[1]);
    damped_complex.gamma = M.gamma + pole * time_s * st_friction_factor(p, 2, middle[2]);
    damped_complex.alpha_beta = M.alpha_beta, damped_complex.alpha_gamma = M.alpha_gamma;
    damped_complex.beta_gamma = M.beta_gamma;
    for (i = 0; i < 3; i++) {
        before_complex[i] = before[i];
    }
    st_solve_inertia_complex(&damped_complex, before_complex, slowed);
    for (i = 0; i < 3; i++) {
        v[i] = creal(residue * slowed[i]);
    }
}

/* Advance angles and rates by a Runge-Kutta step of order four under a held torque on the hinges. */
static void st_step_rotor(const st_parameters *p, double h, const double torque[3], double q[3], double v[3])
{
    static const double time[3] = {0.5, 0.5, 1}, weight[4] = {1, 2, 2, 1};
    double stage_q[3], stage_v[3], sum_q[3] = {0, 0, 0}, sum_v[3] = {0, 0, 0}, acceleration[3];
    int stage, i;
    for (i = 0; i < 3; i++) {
        stage_q[i] = q[i];
        stage_v[i] = v[i];
    }
    for (stage = 0; stage < 4; stage++) {
        st_hinge_acceleration(p, stage_q, stage_v, torque, acceleration);
        for (i = 0; i < 3; i++) {
            sum_q[i] += weight[stage] * stage_v[i];
            sum_v[i] += weight[stage] * acceleration[i];
            if (stage < 3) {
                stage_q[i] = q[i] + time[stage] * h * stage_v[i];
                stage_v[i] = v[i] + time[stage] * h * acceleration[i];
            }
        }
    }
    for (i = 0; i < 3; i++) {
        q[i] += h / 6 * sum_q[i];
        v[i] += h / 6 * sum_v[i];
    }
}

/* Advance the currents by a step, with EMF e held; add the copper losses; write the mean currents. */
static void st_advance_currents(const st_parameters *p, const double *command, const double e[ST_GROUPS],
    st_plant *plant, double h, double mean[ST_GROUPS])
{
    int j;
    (void)e;
    for (j = 0; j < ST_GROUPS; j++) {
        const double start = plant->x[ST_CURRENT + j];
        const double R = st_resistance(p, j, plant->x[ST_WINDING + j]);
#if ST_VOLTAGES
        const st_shares shares = st_relaxed(h, p->inductance_H[j] / R);
        const double last = (command[j] - e[j]) / R;
#else
        const st_shares shares = st_relaxed(h, p->lag_s[j]);
        const double last = st_clipped(command[j], p->current_limit_A);
#endif
        plant->x[ST_CURRENT + j] = start + shares.settled * (last - start);
        mean[j] = start + shares.mean * (last - start);
        plant->copper_J[j] += R * h
            * (shares.start_start * (start * start) + shares.start_settled * (2 * start * last)
                + shares.settled_settled * (last * last));
    }
}

/* Advance the temperatures by the time since their last update. */
static void st_advance_heat(const st_parameters *p, st_plant *plant)
{
    const double period_s = plant->heat_s;
    double released_J = 0;
    int j;
    for (j = 0; j < ST_GROUPS; j++) {
        const double to_stator_K_W = p->thermal_resistance_K_W[j], capacity_J_K = p->heat_capacity_J_K[j];
        const double settled = st_relaxed(period_s, to_stator_K_W * capacity_J_K).settled;
        double *winding = &plant->x[ST_WINDING + j];
        const double before = *winding;
        const double last = plant->x[ST_STATOR] + to_stator_K_W * (plant->copper_J[j] / period_s);
        *winding += (last - *winding) * settled;
        released_J += plant->copper_J[j] - capacity_J_K * (*winding - before);
        plant->copper_J[j] = 0;
    }
#if ST_THERMAL
    {
        const double gap = 1 / p->air_gap_K_W, outer = 1 / p->stator_to_ambient_K_W;
        const double shaft = 1 / p->rotor_to_ambient_K_W;
        const double stator_W_K = p->stator_heat_capacity_J_K / period_s;
        const double rotor_W_K = p->rotor_heat_capacity_J_K / period_s;
        const double a = stator_W_K + outer + gap, d = rotor_W_K + shaft + gap, determinant = a * d - gap * gap;
        const double stator = stator_W_K * plant->x[ST_STATOR] + outer * p->ambient_degC + released_J / period_s;
        const double rotor = rotor_W_K * plant->x[ST_ROTOR] + shaft * p->ambient_degC;
        plant->x[ST_STATOR] = (d * stator + gap * rotor) / determinant;
        plant->x[ST_ROTOR] = (a * rotor + gap * stator) / determinant;
    }
#else
    (void)released_J;
#endif
    plant->heat_s = 0;
}

int st_plant_verdict(const st_plant *plant)
{
    int i;
    if (st_check(plant->x, ST_STATE_BOUNDS, ST_STATES)) {
        return ST_DIVERGED;
    }
    for (i = 0; i < 3; i++) {
        if (!(ST_HINGE_RANGE[i][0] <= plant->x[ST_Q + i] && plant->x[ST_Q + i] <= ST_HINGE_RANGE[i][1])) {
            return ST_LEFT_WORKSPACE;
        }
    }
    return ST_OK;
}

/* Step of checked numbers. */
static int st_step(const st_parameters *p, const double *input, st_plant *plant, double h)
{
    double *q = plant->x + ST_Q, *v = plant->x + ST_QDOT;
    double middle_q[3], middle_v[3], coil_q[3], coil_v[3], torque_S[3], torque[3];
    double G[3][ST_GROUPS], e[ST_GROUPS] = {0}, mean[ST_GROUPS];
    int i, slows = 0;
    for (i = 0; i < 3; i++) {
        middle_q[i] = q[i] + h / 2 * v[i];
        middle_v[i] = v[i] + (v[i] - plant->last_qdot[i]) / 2;
        plant->last_qdot[i] = v[i];
        slows |= p->coulomb_Nm[i] > 0 || p->viscous_Nm_s[i] > 0;
    }
    if (slows) {
        st_slow_down(p, h / 2, q, v);
    }
    st_coil_motion(middle_q, middle_v, coil_q, coil_v);
    st_torque_matrix(coil_q, G);
#if ST_VOLTAGES
    st_back_emf(p, plant->x[ST_ROTOR], coil_q, coil_v, G, e);
#endif
    st_advance_currents(p, input + ST_COMMAND, e, plant, h, mean);
    st_coil_torque(p, plant->x[ST_ROTOR], G, mean, torque_S);
    st_hinge_torque_of(middle_q, torque_S, torque);
    for (i = 0; i < 3; i++) {
        torque[i] -= input[ST_DISTURBANCE + i] + p->constant_torque_Nm[i] + p->spring_Nm_rad[i] * middle_q[i];
    }
    st_step_rotor(p, h, torque, q, v);
    if (slows) {
        st_slow_down(p, h / 2, q, v);
    }
    plant->heat_s += h;
    if (plant->heat_s >= p->thermal_period_s * (1 - 1e-9)) {
        st_advance_heat(p, plant);
    }
    return st_plant_verdict(plant);
}

int st_plant_step(const st_parameters *p, const double *input, st_plant *plant, double h)
{
    const st_plant before = *plant;
    int verdict;
    if (!(h >= ST_SHORTEST_S && h <= 1) || st_plant_check(p, input, plant)) {
        return ST_INVALID;
    }
    verdict = st_step(p, input, plant, h);
    if (verdict == ST_DIVERGED) {
        *plant = before;
    }
    return verdict;
}

int st_plant_advance(
    const st_parameters *p, const double *input, st_plant *plant, double duration_s, double *reached_s)
{
    const st_plant before = *plant;
    double periods, steps, step, h;
    *reached_s = 0;
    if (!(duration_s >= ST_SHORTEST_S && duration_s <= ST_MOST_STEPS_A_CALL * p->step_s)
        || st_plant_check(p, input, plant)) {
        return ST_INVALID;
    }
    periods = duration_s / p->step_s;
    steps = fmax(1, ceil(periods - 1e-6));
    /* A whole multiple of the step is one to rounding only. */
    h = fabs(periods - steps) < 1e-6 ? p->step_s : duration_s / steps;
    for (step = 0; step < steps; step++) {
        const int verdict = st_step(p, input, plant, h);
        if (verdict == ST_DIVERGED) {
            *plant = before;
            *reached_s = 0;
            return verdict;
        }
        *reached_s += h;
        if (verdict != ST_OK) {
            return verdict;
        }
    }
    return ST_OK;
}
