/* SPDX-License-Identifier: MIT */
/* Instance of a functional mock-up unit, common to both versions of the interface.
 *
 * Value references: 0 is the time; then the states, their derivatives, the inputs, the parameters, each in the
 * order of st_plant.h and st_plant_model.h.
 */
#ifndef ST_FMU_H
#define ST_FMU_H

#include <stddef.h>

#include "st_plant.h"

#if defined _WIN32
#define ST_EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define ST_EXPORT __attribute__((visibility("default")))
#else
#define ST_EXPORT
#endif

enum {
    ST_PARAMETERS = sizeof(st_parameters) / sizeof(double),
    ST_FIRST_STATE = 1,
    ST_FIRST_DERIVATIVE = ST_FIRST_STATE + ST_STATES,
    ST_FIRST_INPUT = ST_FIRST_DERIVATIVE + ST_STATES,
    ST_FIRST_PARAMETER = ST_FIRST_INPUT + ST_INPUTS,
    ST_VALUES = ST_FIRST_PARAMETER + ST_PARAMETERS
};

/* Everything that a saved state holds: numbers only. */
typedef struct {
    double time_s;
    double input[ST_INPUTS];
    st_parameters parameters;
    st_plant plant;
    double terminated; /* 1 after the hinges left their range */
} st_snapshot;

typedef struct {
    st_snapshot now;
    int started;      /* 1 after initialisation: the fixed-step method has a state of its own then */
    void *environment;
    void (*log)(void *environment, const char *message); /* of an error; may be null */
} st_fmu;

/* Result: numbers beyond their bounds, or a motion without derivatives, are discarded. After a discard and after an
 * error the instance is as it was before the call. */
enum { ST_FMU_ERROR, ST_FMU_OK, ST_FMU_DISCARD };

/* New instance with the values of the scenario; null without memory. */
st_fmu *st_fmu_new(void);
void st_fmu_reset(st_fmu *fmu);

int st_fmu_get(const st_fmu *fmu, const unsigned *references, size_t count, double *values);
int st_fmu_set(st_fmu *fmu, const unsigned *references, size_t count, const double *values);
int st_fmu_set_time(st_fmu *fmu, double time_s);
int st_fmu_start(st_fmu *fmu);

/* ST_FMU_OK also if the hinges left their range: then `terminated` is set. */
int st_fmu_advance(st_fmu *fmu, double time_s, double duration_s);
int st_fmu_derivatives(const st_fmu *fmu, double *derivatives, size_t count);
int st_fmu_set_states(st_fmu *fmu, const double *x, size_t count);
int st_fmu_get_states(const st_fmu *fmu, double *x, size_t count);

/* 1 if a hinge is beyond its range. */
int st_fmu_outside(const st_fmu *fmu);
int st_fmu_directional(const st_fmu *fmu, const unsigned *unknowns, size_t unknown_count, const unsigned *knowns,
    size_t known_count, const double *seed, double *sensitivity);

/* Saved states. The bytes of one end in a check sum: damaged ones are refused. */
int st_fmu_save(const st_fmu *fmu, void **saved);
int st_fmu_restore(st_fmu *fmu, const void *saved);
void st_fmu_release(void **saved);
enum { ST_SUM_SIZE = 8, ST_SERIAL_SIZE = sizeof(st_snapshot) + 1 + ST_SUM_SIZE };
int st_fmu_serialise(const void *saved, void *bytes, size_t size);
int st_fmu_deserialise(const void *bytes, size_t size, void **saved);

/* Report an error by the log function. */
void st_fmu_report(const st_fmu *fmu, const char *message);

#endif
