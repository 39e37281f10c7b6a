/* SPDX-License-Identifier: MIT */
/* Functions of libm and tolerances for the number type of the controller. */
#ifndef ST_NUMBERS_H
#define ST_NUMBERS_H

#include <math.h>

#if defined ST_SINGLE && !defined ST_REAL
#define st_sin sinf
#define st_cos cosf
#define st_sqrt sqrtf
#define st_exp expf
#define st_pow powf
#define st_fabs fabsf
#define st_copysign copysignf
#define ST_SINGULAR 1e-9f    /* share of the determinant of a matrix that has lost rank */
#define ST_ROUNDING 1e-6f    /* share of a distance or a rate that is rounding */
#define ST_FLAT 1e-5f        /* share of a vector's length that counts as none */
#define ST_EXACT 1e-5f       /* share of a result that counts as an error */
#define ST_SOUND 1e-3f       /* least pivot for a direct solution */
#define ST_ABOVE 1e-5f       /* by which a start value exceeds a root */
#else
#ifndef ST_REAL
#define st_sin sin
#define st_cos cos
#define st_sqrt sqrt
#define st_exp exp
#define st_pow pow
#define st_fabs fabs
#define st_copysign copysign
#endif
#define ST_SINGULAR 1e-12
#define ST_ROUNDING 1e-12
#define ST_FLAT 1e-10
#define ST_EXACT 1e-11
#define ST_SOUND 1e-6
#define ST_ABOVE 1e-12
#endif

static inline st_real st_least(st_real a, st_real b)
{
    return b < a ? b : a;
}

static inline st_real st_greatest(st_real a, st_real b)
{
    return b > a ? b : a;
}

/* Value within a bound of both signs. */
static inline st_real st_within(st_real value, st_real bound)
{
    return st_least(st_greatest(value, -bound), bound);
}

static inline int st_finite(st_real value)
{
    return st_fabs(value) < (st_real)HUGE_VAL;
}

#endif
