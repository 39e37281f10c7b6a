/* SPDX-License-Identifier: MIT */
/* Instance of a functional mock-up unit, common to both versions of the interface. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "st_fmu.h"

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

void st_fmu_start(st_fmu *fmu)
{
    double x[ST_STATES];
    memcpy(x, fmu->now.plant.x, sizeof x);
    st_plant_start(&fmu->now.plant, x);
    fmu->started = 1;
}

void st_fmu_derivatives(const st_fmu *fmu, double *derivatives)
{
    st_plant_derivatives(&fmu->now.parameters, fmu->now.input, fmu->now.plant.x, derivatives);
}

int st_fmu_get(const st_fmu *fmu, const unsigned *references, size_t count, double *values)
{
    double derivatives[ST_STATES];
    int computed = 0;
    size_t i;
    for (i = 0; i < count; i++) {
        const unsigned at = references[i];
        if (at == 0) {
            values[i] = fmu->now.time_s;
        } else if (at < ST_FIRST_DERIVATIVE) {
            values[i] = fmu->now.plant.x[at - ST_FIRST_STATE];
        } else if (at < ST_FIRST_INPUT) {
            if (!computed) {
                st_fmu_derivatives(fmu, derivatives);
                computed = 1;
            }
            values[i] = derivatives[at - ST_FIRST_DERIVATIVE];
        } else if (at < ST_FIRST_PARAMETER) {
            values[i] = fmu->now.input[at - ST_FIRST_INPUT];
        } else if (at < ST_VALUES) {
            values[i] = ((const double *)&fmu->now.parameters)[at - ST_FIRST_PARAMETER];
        } else {
            st_fmu_report(fmu, "get: expected a value reference of the model description");
            return 0;
        }
    }
    return 1;
}

int st_fmu_set(st_fmu *fmu, const unsigned *references, size_t count, const double *values)
{
    size_t i;
    for (i = 0; i < count; i++) {
        const unsigned at = references[i];
        if (!(fabs(values[i]) <= HUGE_VAL) || isinf(values[i])) {
            st_fmu_report(fmu, "set: expected a finite number");
            return 0;
        }
        if (at >= ST_FIRST_STATE && at < ST_FIRST_DERIVATIVE && !fmu->started) {
            fmu->now.plant.x[at - ST_FIRST_STATE] = values[i];
        } else if (at >= ST_FIRST_INPUT && at < ST_FIRST_PARAMETER) {
            fmu->now.input[at - ST_FIRST_INPUT] = values[i];
        } else if (at >= ST_FIRST_PARAMETER && at < ST_VALUES) {
            ((double *)&fmu->now.parameters)[at - ST_FIRST_PARAMETER] = values[i];
        } else {
            st_fmu_report(fmu, "set: expected an input, a parameter or, before the start, a state");
            return 0;
        }
    }
    return 1;
}

int st_fmu_advance(st_fmu *fmu, double time_s, double duration_s)
{
    double reached_s = 0;
    int verdict;
    if (fmu->now.terminated != 0 || !(duration_s > 0)) {
        st_fmu_report(fmu, "step: expected a positive duration and hinges within their range");
        return 0;
    }
    verdict = st_plant_advance(&fmu->now.parameters, fmu->now.input, &fmu->now.plant, duration_s, &reached_s);
    fmu->now.time_s = verdict == ST_OK ? time_s + duration_s : time_s + reached_s;
    if (verdict == ST_DIVERGED) {
        st_fmu_report(fmu, "step: the motion diverged");
        return 0;
    }
    if (verdict == ST_LEFT_WORKSPACE) {
        st_fmu_report(fmu, "step: the hinges left their range");
        fmu->now.terminated = 1;
    }
    return 1;
}

int st_fmu_directional(const st_fmu *fmu, const unsigned *unknowns, size_t unknown_count, const unsigned *knowns,
    size_t known_count, const double *seed, double *sensitivity)
{
    double input[ST_INPUTS] = {0}, x[ST_STATES] = {0}, derivatives[ST_STATES];
    size_t i;
    for (i = 0; i < known_count; i++) {
        const unsigned at = knowns[i];
        if (at >= ST_FIRST_STATE && at < ST_FIRST_DERIVATIVE) {
            x[at - ST_FIRST_STATE] += seed[i];
        } else if (at >= ST_FIRST_INPUT && at < ST_FIRST_PARAMETER) {
            input[at - ST_FIRST_INPUT] += seed[i];
        } else {
            st_fmu_report(fmu, "directional derivative: expected inputs and states as knowns");
            return 0;
        }
    }
    st_plant_directional(&fmu->now.parameters, fmu->now.input, fmu->now.plant.x, input, x, derivatives);
    for (i = 0; i < unknown_count; i++) {
        const unsigned at = unknowns[i];
        if (at >= ST_FIRST_STATE && at < ST_FIRST_DERIVATIVE) {
            sensitivity[i] = x[at - ST_FIRST_STATE]; /* an output is a state */
        } else if (at >= ST_FIRST_DERIVATIVE && at < ST_FIRST_INPUT) {
            sensitivity[i] = derivatives[at - ST_FIRST_DERIVATIVE];
        } else {
            st_fmu_report(fmu, "directional derivative: expected outputs and derivatives as unknowns");
            return 0;
        }
    }
    return 1;
}

int st_fmu_save(const st_fmu *fmu, void **saved)
{
    if (!*saved) {
        *saved = malloc(sizeof(st_fmu));
    }
    if (*saved) {
        memcpy(*saved, fmu, sizeof(st_fmu));
    }
    return *saved != NULL;
}

int st_fmu_restore(st_fmu *fmu, const void *saved)
{
    const st_fmu *other = saved;
    if (!other) {
        return 0;
    }
    fmu->now = other->now;
    fmu->started = other->started;
    return 1;
}

void st_fmu_release(void **saved)
{
    free(*saved);
    *saved = NULL;
}

int st_fmu_serialise(const void *saved, void *bytes, size_t size)
{
    const st_fmu *fmu = saved;
    if (!fmu || size != ST_SERIAL_SIZE) {
        return 0;
    }
    memcpy(bytes, &fmu->now, sizeof fmu->now);
    ((unsigned char *)bytes)[sizeof fmu->now] = (unsigned char)fmu->started;
    return 1;
}

int st_fmu_deserialise(const void *bytes, size_t size, void **saved)
{
    st_fmu *fmu;
    if (size != ST_SERIAL_SIZE) {
        return 0;
    }
    if (!*saved) {
        *saved = calloc(1, sizeof(st_fmu));
    }
    fmu = *saved;
    if (!fmu) {
        return 0;
    }
    memcpy(&fmu->now, bytes, sizeof fmu->now);
    fmu->started = ((const unsigned char *)bytes)[sizeof fmu->now];
    return 1;
}

int st_fmu_set_states(st_fmu *fmu, const double *x, size_t count)
{
    if (count != ST_STATES) {
        return 0;
    }
    memcpy(fmu->now.plant.x, x, sizeof fmu->now.plant.x);
    return 1;
}

int st_fmu_get_states(const st_fmu *fmu, double *x, size_t count)
{
    if (count != ST_STATES) {
        return 0;
    }
    memcpy(x, fmu->now.plant.x, sizeof fmu->now.plant.x);
    return 1;
}

int st_fmu_outside(const st_fmu *fmu)
{
    return st_plant_verdict(&fmu->now.plant) == ST_LEFT_WORKSPACE;
}
