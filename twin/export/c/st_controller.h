/* SPDX-License-Identifier: MIT */
/* One control tick: estimator of rates, law, allocation of currents, by the nominal model alone.
 *
 * Fixed memory: everything that a tick changes is in st_controller, tables are constant, nothing is allocated,
 * and no function calls itself. With ST_SINGLE all numbers are float instead of double.
 * libm: sin, cos, sqrt, fabs, floor, copysign; AFSM and AFSM-ESO also exp; the differentiator pow.
 */
#ifndef ST_CONTROLLER_H
#define ST_CONTROLLER_H

#include "st_controller_model.h" /* generated: sizes, and the parts of this controller */

#ifdef __cplusplus
extern "C" {
#endif

#if defined ST_REAL
typedef ST_REAL st_real;
#elif defined ST_SINGLE
typedef float st_real;
#else
typedef double st_real;
#endif

typedef struct {
    st_real law[ST_LAW_STATE + 1]; /* the last entry is not used: no array is empty */
    st_real estimator[ST_ESTIMATOR_STATE + 1];
#if ST_APPLIED_TORQUE
    st_real commands[ST_COMMANDS][ST_GROUPS]; /* A, newest first */
    st_real current[ST_GROUPS];               /* A, estimated */
#endif
    st_real applied_torque[3]; /* N m on the hinges, over the last period */
#if ST_GOVERNOR
    st_real governed[3][3]; /* angle, rate, acceleration */
    int governed_started;
#endif
#if ST_FEED_FORWARD
    st_real fed_forward[ST_FED_FORWARD][3]; /* N m, newest first */
#endif
} st_controller;

/* State before the first tick. */
void st_controller_start(st_controller *controller);

/* Run one tick, every ST_PERIOD_S seconds.
 *
 * reference: desired angles (rad), rates (rad/s) and accelerations (rad/s^2) of the hinges as rows.
 * angle, rate: measured. With an estimator `rate` is not read.
 * command: result, current of each group in A.
 * Returns the share of the law's torque that the commands give. Returns -1, with commands of 0 and the state as it
 * was, if an input is beyond its bounds in st_controller_tables.h or not finite, or if a result would not be
 * finite. The bounds are those of angles, rates, accelerations, and of the distance of an angle from the desired
 * one. A refused tick has no effect on later ones. */
st_real st_controller_tick(st_controller *controller, const st_real reference[3][3], const st_real angle[3],
    const st_real rate[3], st_real command[ST_GROUPS]);

#ifdef __cplusplus
}
#endif
#endif
