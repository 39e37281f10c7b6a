/* SPDX-License-Identifier: MIT */
/* Instance of a functional mock-up unit, common to both versions of the interface. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "st_fmu.h"
#include "st_plant_bounds.h" /* generated */

void st_fmu_report(const st_fmu *fmu, const char *message)
{
    if (fmu->log) {
        fmu->log(fmu->environment, message);
    }
}

void st_fmu_reset(st_fmu *fmu)
{
    double x[ST_STATES];
    memset(&fmu->now, 0, sizeof fmu->now);
    st_plant_defaults(&fmu->now.parameters, x);
    st_plant_start(&fmu->now.plant, x);
    fmu->started = 0;
}

st_fmu *st_fmu_new(void)
{
    st_fmu *fmu = calloc(1, sizeof *fmu);
    if (fmu) {
        st_fmu_reset(fmu);
    }
    return fmu;
}

int st_fmu_start(st_fmu *fmu)
{
    double x[ST_STATES];
    if (!fmu) {
        return ST_FMU_ERROR;
    }
    memcpy(x, fmu->now.plant.x, sizeof x);
    if (st_plant_start(&fmu->now.plant, x) != ST_OK) {
        return ST_FMU_ERROR;
    }
    fmu->started = 1;
    return ST_FMU_OK;
}

int st_fmu_set_time(st_fmu *fmu, double time_s)
{
    if (!fmu || !(fabs(time_s) < HUGE_VAL)) {
        return ST_FMU_ERROR;
    }
    fmu->now.time_s = time_s;
    return ST_FMU_OK;
}

int st_fmu_derivatives(const st_fmu *fmu, double *derivatives, size_t count)
{
    if (!fmu || count != ST_STATES) {
        return ST_FMU_ERROR;
    }
    if (st_plant_derivatives(&fmu->now.parameters, fmu->now.input, fmu->now.plant.x, derivatives) != ST_OK) {
        st_fmu_report(fmu, "derivatives: expected states and parameters with finite ones");
        return ST_FMU_DISCARD;
    }
    return ST_FMU_OK;
}

int st_fmu_get(const st_fmu *fmu, const unsigned *references, size_t count, double *values)
{
    double derivatives[ST_STATES];
    int computed = 0;
    size_t i;
    if (!fmu) {
        return ST_FMU_ERROR;
    }
    for (i = 0; i < count; i++) {
        const unsigned at = references[i];
        if (at == 0) {
            values[i] = fmu->now.time_s;
        } else if (at < ST_FIRST_DERIVATIVE) {
            values[i] = fmu->now.plant.x[at - ST_FIRST_STATE];
        } else if (at < ST_FIRST_INPUT) {
            if (!computed && st_fmu_derivatives(fmu, derivatives, ST_STATES) != ST_FMU_OK) {
                return ST_FMU_DISCARD;
            }
            computed = 1;
            values[i] = derivatives[at - ST_FIRST_DERIVATIVE];
        } else if (at < ST_FIRST_PARAMETER) {
            values[i] = fmu->now.input[at - ST_FIRST_INPUT];
        } else if (at < ST_VALUES) {
            values[i] = ((const double *)&fmu->now.parameters)[at - ST_FIRST_PARAMETER];
        } else {
            st_fmu_report(fmu, "get: expected a value reference of the model description");
            return ST_FMU_ERROR;
        }
    }
    return ST_FMU_OK;
}

/* Number of a snapshot that can be set, with its bounds; null if there is none with this reference. */
static double *st_settable(st_snapshot *now, int started, unsigned at, const double **bounds)
{
    if (at >= ST_FIRST_STATE && at < ST_FIRST_DERIVATIVE && !started) {
        *bounds = ST_STATE_BOUNDS[at - ST_FIRST_STATE];
        return &now->plant.x[at - ST_FIRST_STATE];
    }
    if (at >= ST_FIRST_INPUT && at < ST_FIRST_PARAMETER) {
        *bounds = ST_INPUT_BOUNDS[at - ST_FIRST_INPUT];
        return &now->input[at - ST_FIRST_INPUT];
    }
    if (at >= ST_FIRST_PARAMETER && at < ST_VALUES - (started ? ST_FIXED_PARAMETERS : 0)) {
        *bounds = ST_PARAMETER_BOUNDS[at - ST_FIRST_PARAMETER];
        return (double *)&now->parameters + (at - ST_FIRST_PARAMETER);
    }
    return NULL;
}

int st_fmu_set(st_fmu *fmu, const unsigned *references, size_t count, const double *values)
{
    st_snapshot changed;
    size_t i;
    if (!fmu) {
        return ST_FMU_ERROR;
    }
    changed = fmu->now;
    for (i = 0; i < count; i++) {
        const double *bounds = NULL;
        double *number = st_settable(&changed, fmu->started, references[i], &bounds);
        if (!number) {
            st_fmu_report(fmu, "set: expected an input, a tunable parameter or, before the start, a state or a fixed parameter");
            return ST_FMU_ERROR;
        }
        if (!(bounds[0] <= values[i] && values[i] <= bounds[1])) {
            char message[128];
            (void)snprintf(message, sizeof message, "set: expected a value from %g to %g for reference %u, received %g",
                bounds[0], bounds[1], references[i], values[i]);
            st_fmu_report(fmu, message);
            return ST_FMU_DISCARD;
        }
        *number = values[i];
    }
    fmu->now = changed;
    return ST_FMU_OK;
}

int st_fmu_advance(st_fmu *fmu, double time_s, double duration_s)
{
    double reached_s = 0;
    int verdict;
    if (!fmu) {
        return ST_FMU_ERROR;
    }
    if (fmu->now.terminated != 0 || !(fabs(time_s) < HUGE_VAL)) {
        st_fmu_report(fmu, "step: expected a finite time and hinges within their range");
        return ST_FMU_ERROR;
    }
    verdict = st_plant_advance(&fmu->now.parameters, fmu->now.input, &fmu->now.plant, duration_s, &reached_s);
    if (verdict == ST_INVALID) {
        st_fmu_report(fmu, "step: expected a duration from 1e-12 s to 1e7 times step_s");
        return ST_FMU_ERROR;
    }
    if (verdict == ST_DIVERGED) {
        st_fmu_report(fmu, "step: the motion diverged");
        return ST_FMU_ERROR;
    }
    fmu->now.time_s = verdict == ST_OK ? time_s + duration_s : time_s + reached_s;
    if (verdict == ST_LEFT_WORKSPACE) {
        st_fmu_report(fmu, "step: the hinges left their range");
        fmu->now.terminated = 1;
    }
    return ST_FMU_OK;
}

int st_fmu_directional(const st_fmu *fmu, const unsigned *unknowns, size_t unknown_count, const unsigned *knowns,
    size_t known_count, const double *seed, double *sensitivity)
{
    double input[ST_INPUTS] = {0}, x[ST_STATES] = {0}, derivatives[ST_STATES];
    size_t i;
    if (!fmu) {
        return ST_FMU_ERROR;
    }
    for (i = 0; i < known_count; i++) {
        const unsigned at = knowns[i];
        if (at >= ST_FIRST_STATE && at < ST_FIRST_DERIVATIVE) {
            x[at - ST_FIRST_STATE] += seed[i];
        } else if (at >= ST_FIRST_INPUT && at < ST_FIRST_PARAMETER) {
            input[at - ST_FIRST_INPUT] += seed[i];
        } else {
            st_fmu_report(fmu, "directional derivative: expected inputs and states as knowns");
            return ST_FMU_ERROR;
        }
    }
    if (st_plant_directional(&fmu->now.parameters, fmu->now.input, fmu->now.plant.x, input, x, derivatives) != ST_OK) {
        st_fmu_report(fmu, "directional derivative: expected a finite seed, and states with finite derivatives");
        return ST_FMU_DISCARD;
    }
    for (i = 0; i < unknown_count; i++) {
        const unsigned at = unknowns[i];
        if (at >= ST_FIRST_STATE && at < ST_FIRST_DERIVATIVE) {
            sensitivity[i] = x[at - ST_FIRST_STATE]; /* an output is a state */
        } else if (at >= ST_FIRST_DERIVATIVE && at < ST_FIRST_INPUT) {
            sensitivity[i] = derivatives[at - ST_FIRST_DERIVATIVE];
        } else {
            st_fmu_report(fmu, "directional derivative: expected outputs and derivatives as unknowns");
            return ST_FMU_ERROR;
        }
    }
    return ST_FMU_OK;
}

int st_fmu_save(const st_fmu *fmu, void **saved)
{
    if (!fmu || !saved) {
        return ST_FMU_ERROR;
    }
    if (!*saved) {
        *saved = malloc(sizeof(st_fmu));
    }
    if (*saved) {
        memcpy(*saved, fmu, sizeof(st_fmu));
    }
    return *saved ? ST_FMU_OK : ST_FMU_ERROR;
}

int st_fmu_restore(st_fmu *fmu, const void *saved)
{
    const st_fmu *other = saved;
    if (!fmu || !other) {
        return ST_FMU_ERROR;
    }
    fmu->now = other->now;
    fmu->started = other->started;
    return ST_FMU_OK;
}

void st_fmu_release(void **saved)
{
    if (saved) {
        free(*saved);
        *saved = NULL;
    }
}

/* Write the check sum of bytes (FNV-1a of 64 bits). */
static void st_write_sum(const unsigned char *bytes, size_t size, unsigned char sum[ST_SUM_SIZE])
{
    uint64_t hash = UINT64_C(14695981039346656037);
    size_t i;
    for (i = 0; i < size; i++) {
        hash = (hash ^ bytes[i]) * UINT64_C(1099511628211);
    }
    for (i = 0; i < ST_SUM_SIZE; i++) {
        sum[i] = (unsigned char)(hash >> (8 * i) & 0xff);
    }
}

int st_fmu_serialise(const void *saved, void *bytes, size_t size)
{
    const st_fmu *fmu = saved;
    unsigned char *content = bytes;
    if (!fmu || !bytes || size != ST_SERIAL_SIZE) {
        return ST_FMU_ERROR;
    }
    memcpy(content, &fmu->now, sizeof fmu->now);
    content[sizeof fmu->now] = (unsigned char)fmu->started;
    st_write_sum(content, ST_SERIAL_SIZE - ST_SUM_SIZE, content + ST_SERIAL_SIZE - ST_SUM_SIZE);
    return ST_FMU_OK;
}

int st_fmu_deserialise(const void *bytes, size_t size, void **saved)
{
    const unsigned char *content = bytes;
    unsigned char sum[ST_SUM_SIZE];
    st_snapshot now;
    st_fmu *fmu;
    if (!bytes || !saved || size != ST_SERIAL_SIZE) {
        return ST_FMU_ERROR;
    }
    st_write_sum(content, ST_SERIAL_SIZE - ST_SUM_SIZE, sum);
    memcpy(&now, content, sizeof now);
    if (memcmp(sum, content + ST_SERIAL_SIZE - ST_SUM_SIZE, ST_SUM_SIZE) != 0 || !(fabs(now.time_s) < HUGE_VAL)
        || st_plant_check(&now.parameters, now.input, &now.plant) != ST_OK) {
        return ST_FMU_ERROR;
    }
    fmu = *saved ? *saved : calloc(1, sizeof(st_fmu));
    if (!fmu) {
        return ST_FMU_ERROR;
    }
    fmu->now = now;
    fmu->started = content[sizeof now] != 0;
    *saved = fmu;
    return ST_FMU_OK;
}

int st_fmu_set_states(st_fmu *fmu, const double *x, size_t count)
{
    size_t i;
    if (!fmu || count != ST_STATES) {
        return ST_FMU_ERROR;
    }
    for (i = 0; i < count; i++) {
        if (!(ST_STATE_BOUNDS[i][0] <= x[i] && x[i] <= ST_STATE_BOUNDS[i][1])) {
            st_fmu_report(fmu, "states: expected finite ones within the bounds of the model description");
            return ST_FMU_DISCARD;
        }
    }
    memcpy(fmu->now.plant.x, x, sizeof fmu->now.plant.x);
    return ST_FMU_OK;
}

int st_fmu_get_states(const st_fmu *fmu, double *x, size_t count)
{
    if (!fmu || count != ST_STATES) {
        return ST_FMU_ERROR;
    }
    memcpy(x, fmu->now.plant.x, sizeof fmu->now.plant.x);
    return ST_FMU_OK;
}

int st_fmu_outside(const st_fmu *fmu)
{
    return fmu && st_plant_verdict(&fmu->now.plant) == ST_LEFT_WORKSPACE;
}
