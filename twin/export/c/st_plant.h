/* SPDX-License-Identifier: MIT */
/* Plant of a spherical actuator: rotor on three hinges, coil currents, temperatures.
 *
 * State, input and parameters are values of the caller: no memory is allocated and nothing is global.
 * All functions are reentrant. Needs a C99 compiler with complex numbers, and sin, cos, sqrt, expm1, fabs, fmax,
 * ceil (a general joint also atan2 and asin) of libm.
 *
 * Every function checks its numbers: those beyond the bounds of st_plant_bounds.h, infinite ones and NaN give
 * ST_INVALID. After ST_INVALID and ST_DIVERGED state and results are as they were before the call.
 */
#ifndef ST_PLANT_H
#define ST_PLANT_H

#include "st_plant_model.h" /* generated: ST_GROUPS, ST_VOLTAGES, ST_THERMAL, st_parameters */

#ifdef __cplusplus
extern "C" {
#endif

/* Continuous states, in this order: hinge angles alpha, beta, gamma in rad; their rates in rad/s; current of
 * each group in A; temperature of its winding, of the stator and of the rotor in degrees Celsius. */
enum {
    ST_Q = 0,
    ST_QDOT = 3,
    ST_CURRENT = 6,
    ST_WINDING = 6 + ST_GROUPS,
    ST_STATOR = 6 + 2 * ST_GROUPS,
    ST_ROTOR,
    ST_STATES
};

/* Inputs, in this order: commanded current in A or voltage in V of each group; generalised disturbance torque
 * on the hinges in N m, which is subtracted from that of the coils. */
enum { ST_COMMAND = 0, ST_DISTURBANCE = ST_GROUPS, ST_INPUTS = ST_GROUPS + 3 };

typedef struct {
    double x[ST_STATES];
    double last_qdot[3];          /* rad/s, before the last step */
    double copper_J[ST_GROUPS];   /* loss since the last update of the temperatures */
    double heat_s;                /* time since that update */
} st_plant;

/* Result: the hinges left their range; the result is beyond the bounds or no number; an argument is. */
enum { ST_OK = 0, ST_LEFT_WORKSPACE = 1, ST_DIVERGED = 2, ST_INVALID = 3 };

/* Shortest duration of a step or of an advance, in s, and most steps of an advance. */
#define ST_SHORTEST_S 1e-12
#define ST_MOST_STEPS_A_CALL 1e7

/* Parameters and states x[ST_STATES] of the scenario at its start. */
void st_plant_defaults(st_parameters *parameters, double *x);

/* ST_OK if these numbers are within their bounds. */
int st_plant_check(const st_parameters *parameters, const double *input, const st_plant *plant);

/* Start at states x[ST_STATES]. After invalid ones every step gives ST_INVALID until the next start. */
int st_plant_start(st_plant *plant, const double *x);

/* Advance by one step of h seconds, at most 1, under a held input[ST_INPUTS]; the method is of second order. */
int st_plant_step(const st_parameters *parameters, const double *input, st_plant *plant, double h);

/* Verdict on the present motion. */
int st_plant_verdict(const st_plant *plant);

/* Advance by a duration, in equal steps of at most parameters->step_s; stops at the step that leaves the range of
 * the hinges. `reached_s` is the time that was simulated: 0 after ST_INVALID and ST_DIVERGED. */
int st_plant_advance(
    const st_parameters *parameters, const double *input, st_plant *plant, double duration_s, double *reached_s);

/* Time derivatives of the states. */
int st_plant_derivatives(
    const st_parameters *parameters, const double *input, const double *x, double *derivatives);

/* Derivative of `st_plant_derivatives` along a direction of inputs and states, exact to rounding. */
int st_plant_directional(const st_parameters *parameters, const double *input, const double *x,
    const double *input_direction, const double *x_direction, double *result);

#ifdef __cplusplus
}
#endif
#endif
