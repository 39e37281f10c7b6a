/* SPDX-License-Identifier: MIT */
/* Functional Mock-up Interface 2.0: co-simulation and model exchange. */
#include <stdlib.h>
#include <string.h>

#include "st_fmu.h"
#include "st_fmu_token.h" /* generated: ST_TOKEN */

#ifdef ST_STANDARD_HEADERS
#include "fmi2Functions.h"
#else
typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef char fmi2Char, fmi2Byte;
typedef const fmi2Char *fmi2String;
enum { fmi2False, fmi2True };
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;
typedef struct {
    fmi2Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged, nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;
#endif

/* Instance: the functions of the interface receive its address. */
typedef struct {
    st_fmu *fmu;
    const fmi2CallbackFunctions *callbacks;
    char *name;
} st_component;

static st_fmu *fmu_of(fmi2Component c)
{
    return c ? ((st_component *)c)->fmu : NULL;
}

static void send(void *environment, const char *message)
{
    const st_component *component = environment;
    component->callbacks->logger(component->callbacks->componentEnvironment, component->name, fmi2Error,
        "logStatusError", message); /* without conversions */
}

static fmi2Status status(int result)
{
    return result == ST_FMU_OK ? fmi2OK : result == ST_FMU_DISCARD ? fmi2Discard : fmi2Error;
}

static fmi2Status none(size_t count)
{
    return count ? fmi2Error : fmi2OK;
}

ST_EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

ST_EXPORT const char *fmi2GetVersion(void)
{
    return "2.0";
}

ST_EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String names[])
{
    (void)c, (void)on, (void)count, (void)names;
    return fmi2OK;
}

ST_EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String token, fmi2String resources,
    const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    st_component *component;
    (void)kind, (void)resources, (void)visible, (void)logging;
    if (!name || !token || strcmp(token, ST_TOKEN) != 0) {
        if (callbacks && callbacks->logger) {
            callbacks->logger(callbacks->componentEnvironment, name ? name : "?", fmi2Error, "logStatusError",
                "instantiate: expected the guid of this model description");
        }
        return NULL;
    }
    component = calloc(1, sizeof *component);
    if (!component) {
        return NULL;
    }
    component->fmu = st_fmu_new();
    component->name = malloc(strlen(name) + 1);
    component->callbacks = callbacks;
    if (!component->fmu || !component->name) {
        free(component->fmu);
        free(component->name);
        free(component);
        return NULL;
    }
    memcpy(component->name, name, strlen(name) + 1);
    component->fmu->environment = component;
    component->fmu->log = callbacks && callbacks->logger ? send : NULL;
    return component;
}

ST_EXPORT void fmi2FreeInstance(fmi2Component c)
{
    st_component *component = c;
    if (component) {
        free(component->fmu);
        free(component->name);
        free(component);
    }
}

ST_EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
    fmi2Real start, fmi2Boolean has_stop, fmi2Real stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    return status(st_fmu_set_time(fmu_of(c), start));
}

ST_EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    return status(st_fmu_start(fmu_of(c)));
}

ST_EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    if (!c) {
        return fmi2Error;
    }
    st_fmu_reset(fmu_of(c));
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2Real value[])
{
    return status(st_fmu_get(fmu_of(c), vr, count, value));
}

ST_EXPORT fmi2Status fmi2SetReal(
    fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Real value[])
{
    return status(st_fmu_set(fmu_of(c), vr, count, value));
}

/* There are no values of other types. */
#define ST_NO_VALUES(Name)                                                                                       \
    ST_EXPORT fmi2Status fmi2Get##Name(                                                                          \
        fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2##Name value[])                        \
    {                                                                                                            \
        (void)c, (void)vr, (void)value;                                                                          \
        return none(count);                                                                                      \
    }                                                                                                            \
    ST_EXPORT fmi2Status fmi2Set##Name(                                                                          \
        fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2##Name value[])                  \
    {                                                                                                            \
        (void)c, (void)vr, (void)value;                                                                          \
        return none(count);                                                                                      \
    }
ST_NO_VALUES(Integer)
ST_NO_VALUES(Boolean)
ST_NO_VALUES(String)

ST_EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *saved)
{
    return status(st_fmu_save(fmu_of(c), saved));
}

ST_EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate saved)
{
    return status(st_fmu_restore(fmu_of(c), saved));
}

ST_EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *saved)
{
    (void)c;
    st_fmu_release(saved);
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate saved, size_t *size)
{
    (void)c, (void)saved;
    *size = ST_SERIAL_SIZE;
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate saved, fmi2Byte bytes[], size_t size)
{
    (void)c;
    return status(st_fmu_serialise(saved, bytes, size));
}

ST_EXPORT fmi2Status fmi2DeSerializeFMUstate(
    fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *saved)
{
    (void)c;
    return status(st_fmu_deserialise(bytes, size, saved));
}

ST_EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[],
    size_t unknown_count, const fmi2ValueReference knowns[], size_t known_count, const fmi2Real seed[],
    fmi2Real sensitivity[])
{
    return status(
        st_fmu_directional(fmu_of(c), unknowns, unknown_count, knowns, known_count, seed, sensitivity));
}

/* Model exchange. */

ST_EXPORT fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    (void)c;
    info->newDiscreteStatesNeeded = info->terminateSimulation = fmi2False;
    info->nominalsOfContinuousStatesChanged = info->valuesOfContinuousStatesChanged = fmi2False;
    info->nextEventTimeDefined = fmi2False;
    info->nextEventTime = 0;
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2CompletedIntegratorStep(
    fmi2Component c, fmi2Boolean no_set_state, fmi2Boolean *enter_event_mode, fmi2Boolean *terminate)
{
    (void)no_set_state;
    *enter_event_mode = fmi2False;
    *terminate = st_fmu_outside(fmu_of(c)) ? fmi2True : fmi2False;
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    return status(st_fmu_set_time(fmu_of(c), time));
}

ST_EXPORT fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t count)
{
    return status(st_fmu_set_states(fmu_of(c), x, count));
}

ST_EXPORT fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t count)
{
    return status(st_fmu_derivatives(fmu_of(c), derivatives, count));
}

ST_EXPORT fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t count)
{
    (void)c, (void)indicators;
    return none(count);
}

ST_EXPORT fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t count)
{
    return status(st_fmu_get_states(fmu_of(c), x, count));
}

ST_EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t count)
{
    size_t i;
    (void)c;
    for (i = 0; i < count; i++) {
        x[i] = 1;
    }
    return count == ST_STATES ? fmi2OK : fmi2Error;
}

/* Co-simulation. */

ST_EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t count,
    const fmi2Integer order[], const fmi2Real value[])
{
    (void)c, (void)vr, (void)order, (void)value;
    return none(count);
}

ST_EXPORT fmi2Status fmi2GetRealOutputDerivatives(
    fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Integer order[], fmi2Real value[])
{
    (void)c, (void)vr, (void)order, (void)value;
    return none(count);
}

ST_EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real duration, fmi2Boolean no_set_state)
{
    (void)no_set_state;
    if (st_fmu_advance(fmu_of(c), time, duration) != ST_FMU_OK) {
        return fmi2Error;
    }
    return fmu_of(c)->now.terminated != 0 ? fmi2Discard : fmi2OK;
}

ST_EXPORT fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)c;
    return fmi2Error;
}

ST_EXPORT fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

ST_EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (!c || kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = fmu_of(c)->now.time_s;
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

ST_EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (!c || kind != fmi2Terminated) {
        return fmi2Discard;
    }
    *value = fmu_of(c)->now.terminated != 0 ? fmi2True : fmi2False;
    return fmi2OK;
}

ST_EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
