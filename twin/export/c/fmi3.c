/* SPDX-License-Identifier: MIT */
/* Functional Mock-up Interface 3.0: co-simulation and model exchange. */
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "st_fmu.h"
#include "st_fmu_token.h" /* generated: ST_TOKEN */

#ifdef ST_STANDARD_HEADERS
#include "fmi3Functions.h"
#else
typedef void *fmi3Instance, *fmi3InstanceEnvironment, *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8, fmi3Byte;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean, fmi3Clock;
typedef char fmi3Char;
typedef const fmi3Char *fmi3String;
typedef const fmi3Byte *fmi3Binary;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean,
    fmi3Boolean, fmi3Boolean, fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
#endif

/* Instance: the functions of the interface receive its address. */
typedef struct {
    st_fmu *fmu;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} st_component;

static st_fmu *fmu_of(fmi3Instance c)
{
    return c ? ((st_component *)c)->fmu : NULL;
}

static void send(void *environment, const char *message)
{
    const st_component *component = environment;
    component->log(component->environment, fmi3Error, "logStatusError", message);
}

static fmi3Status status(int result)
{
    return result == ST_FMU_OK ? fmi3OK : result == ST_FMU_DISCARD ? fmi3Discard : fmi3Error;
}

static fmi3Status none(size_t count)
{
    return count ? fmi3Error : fmi3OK;
}

static fmi3Instance instantiate(fmi3String token, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    st_component *component;
    if (!token || strcmp(token, ST_TOKEN) != 0) {
        if (log) {
            log(environment, fmi3Error, "logStatusError",
                "instantiate: expected the token of this model description");
        }
        return NULL;
    }
    component = calloc(1, sizeof *component);
    if (!component) {
        return NULL;
    }
    component->fmu = st_fmu_new();
    if (!component->fmu) {
        free(component);
        return NULL;
    }
    component->environment = environment;
    component->log = log;
    component->fmu->environment = component;
    component->fmu->log = log ? send : NULL;
    return component;
}

ST_EXPORT const char *fmi3GetVersion(void)
{
    return "3.0";
}

ST_EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String names[])
{
    (void)c, (void)on, (void)count, (void)names;
    return fmi3OK;
}

ST_EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name, (void)resources, (void)visible, (void)logging;
    return instantiate(token, environment, log);
}

ST_EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
    const fmi3ValueReference required[], size_t count, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
    (void)required, (void)count, (void)update;
    return instantiate(token, environment, log);
}

ST_EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    (void)update, (void)lock, (void)unlock;
    return NULL; /* not supported */
}

ST_EXPORT void fmi3FreeInstance(fmi3Instance c)
{
    if (c) {
        free(fmu_of(c));
        free(c);
    }
}

ST_EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    return status(st_fmu_set_time(fmu_of(c), start));
}

ST_EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    return status(st_fmu_start(fmu_of(c)));
}

ST_EXPORT fmi3Status fmi3Reset(fmi3Instance c)
{
    if (!c) {
        return fmi3Error;
    }
    st_fmu_reset(fmu_of(c));
    return fmi3OK;
}

/* Changes of mode, none of which has an effect. */
#define ST_NO_EFFECT(name, result)                                                                               \
    ST_EXPORT fmi3Status name(fmi3Instance c)                                                                    \
    {                                                                                                            \
        (void)c;                                                                                                 \
        return result;                                                                                           \
    }
ST_NO_EFFECT(fmi3EnterEventMode, fmi3OK)
ST_NO_EFFECT(fmi3EnterContinuousTimeMode, fmi3OK)
ST_NO_EFFECT(fmi3EnterStepMode, fmi3OK)
ST_NO_EFFECT(fmi3EvaluateDiscreteStates, fmi3OK)
ST_NO_EFFECT(fmi3Terminate, fmi3OK)
ST_NO_EFFECT(fmi3EnterConfigurationMode, fmi3Error) /* there are no structural parameters */
ST_NO_EFFECT(fmi3ExitConfigurationMode, fmi3Error)

ST_EXPORT fmi3Status fmi3GetFloat64(
    fmi3Instance c, const fmi3ValueReference vr[], size_t count, fmi3Float64 values[], size_t value_count)
{
    return status(count == value_count ? st_fmu_get(fmu_of(c), vr, count, values) : ST_FMU_ERROR);
}

ST_EXPORT fmi3Status fmi3SetFloat64(
    fmi3Instance c, const fmi3ValueReference vr[], size_t count, const fmi3Float64 values[], size_t value_count)
{
    return status(count == value_count ? st_fmu_set(fmu_of(c), vr, count, values) : ST_FMU_ERROR);
}

/* There are no values of other types. */
#define ST_NO_VALUES(Name)                                                                                       \
    ST_EXPORT fmi3Status fmi3Get##Name(                                                                          \
        fmi3Instance c, const fmi3ValueReference vr[], size_t count, fmi3##Name values[], size_t value_count)    \
    {                                                                                                            \
        (void)c, (void)vr, (void)values, (void)value_count;                                                      \
        return none(count);                                                                                      \
    }                                                                                                            \
    ST_EXPORT fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t count,              \
        const fmi3##Name values[], size_t value_count)                                                           \
    {                                                                                                            \
        (void)c, (void)vr, (void)values, (void)value_count;                                                      \
        return none(count);                                                                                      \
    }
ST_NO_VALUES(Float32)
ST_NO_VALUES(Int8)
ST_NO_VALUES(UInt8)
ST_NO_VALUES(Int16)
ST_NO_VALUES(UInt16)
ST_NO_VALUES(Int32)
ST_NO_VALUES(UInt32)
ST_NO_VALUES(Int64)
ST_NO_VALUES(UInt64)
ST_NO_VALUES(Boolean)
ST_NO_VALUES(String)

ST_EXPORT fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t count, size_t sizes[],
    fmi3Binary values[], size_t value_count)
{
    (void)c, (void)vr, (void)sizes, (void)values, (void)value_count;
    return none(count);
}

ST_EXPORT fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
    const size_t sizes[], const fmi3Binary values[], size_t value_count)
{
    (void)c, (void)vr, (void)sizes, (void)values, (void)value_count;
    return none(count);
}

/* There are no clocks. */
#define ST_NO_CLOCKS(name, ...)                                                                                  \
    ST_EXPORT fmi3Status name(fmi3Instance c, const fmi3ValueReference vr[], size_t count, __VA_ARGS__)          \
    {                                                                                                            \
        (void)c, (void)vr, (void)first, ST_IGNORE;                                                               \
        return none(count);                                                                                      \
    }
#define ST_IGNORE (void)0
ST_NO_CLOCKS(fmi3GetClock, fmi3Clock first[])
ST_NO_CLOCKS(fmi3SetClock, const fmi3Clock first[])
ST_NO_CLOCKS(fmi3GetShiftDecimal, fmi3Float64 first[])
ST_NO_CLOCKS(fmi3SetShiftDecimal, const fmi3Float64 first[])
ST_NO_CLOCKS(fmi3SetIntervalDecimal, const fmi3Float64 first[])
#undef ST_IGNORE
#define ST_IGNORE (void)second
ST_NO_CLOCKS(fmi3GetIntervalDecimal, fmi3Float64 first[], fmi3IntervalQualifier second[])
ST_NO_CLOCKS(fmi3GetShiftFraction, fmi3UInt64 first[], fmi3UInt64 second[])
ST_NO_CLOCKS(fmi3SetShiftFraction, const fmi3UInt64 first[], const fmi3UInt64 second[])
ST_NO_CLOCKS(fmi3SetIntervalFraction, const fmi3UInt64 first[], const fmi3UInt64 second[])
#undef ST_IGNORE
#define ST_IGNORE (void)second, (void)third
ST_NO_CLOCKS(fmi3GetIntervalFraction, fmi3UInt64 first[], fmi3UInt64 second[], fmi3IntervalQualifier third[])

ST_EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *count)
{
    (void)c, (void)vr, (void)count;
    return fmi3Error; /* not supported */
}

ST_EXPORT fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent,
    size_t elements[], fmi3ValueReference independents[], size_t independent_elements[],
    fmi3DependencyKind kinds[], size_t count)
{
    (void)c, (void)dependent, (void)elements, (void)independents, (void)independent_elements, (void)kinds;
    (void)count;
    return fmi3Error; /* not supported */
}

ST_EXPORT fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *saved)
{
    return status(st_fmu_save(fmu_of(c), saved));
}

ST_EXPORT fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState saved)
{
    return status(st_fmu_restore(fmu_of(c), saved));
}

ST_EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *saved)
{
    (void)c;
    st_fmu_release(saved);
    return fmi3OK;
}

ST_EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState saved, size_t *size)
{
    (void)c, (void)saved;
    *size = ST_SERIAL_SIZE;
    return fmi3OK;
}

ST_EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState saved, fmi3Byte bytes[], size_t size)
{
    (void)c;
    return status(st_fmu_serialise(saved, bytes, size));
}

ST_EXPORT fmi3Status fmi3DeserializeFMUState(
    fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *saved)
{
    (void)c;
    return status(st_fmu_deserialise(bytes, size, saved));
}

ST_EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[],
    size_t unknown_count, const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[],
    size_t seed_count, fmi3Float64 sensitivity[], size_t sensitivity_count)
{
    if (seed_count != known_count || sensitivity_count != unknown_count) {
        return fmi3Error;
    }
    return status(
        st_fmu_directional(fmu_of(c), unknowns, unknown_count, knowns, known_count, seed, sensitivity));
}

ST_EXPORT fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[],
    size_t unknown_count, const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[],
    size_t seed_count, fmi3Float64 sensitivity[], size_t sensitivity_count)
{
    (void)c, (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count, (void)seed, (void)seed_count;
    (void)sensitivity, (void)sensitivity_count;
    return fmi3Error; /* not supported */
}

ST_EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate,
    fmi3Boolean *new_nominals, fmi3Boolean *new_states, fmi3Boolean *has_next, fmi3Float64 *next)
{
    (void)c;
    *again = *terminate = *new_nominals = *new_states = *has_next = false;
    *next = 0;
    return fmi3OK;
}

/* Model exchange. */

ST_EXPORT fmi3Status fmi3CompletedIntegratorStep(
    fmi3Instance c, fmi3Boolean no_set_state, fmi3Boolean *enter_event_mode, fmi3Boolean *terminate)
{
    (void)no_set_state;
    *enter_event_mode = false;
    *terminate = st_fmu_outside(fmu_of(c)) != 0;
    return fmi3OK;
}

ST_EXPORT fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time)
{
    return status(st_fmu_set_time(fmu_of(c), time));
}

ST_EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t count)
{
    return status(st_fmu_set_states(fmu_of(c), x, count));
}

ST_EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t count)
{
    return status(st_fmu_get_states(fmu_of(c), x, count));
}

ST_EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 derivatives[], size_t count)
{
    return status(st_fmu_derivatives(fmu_of(c), derivatives, count));
}

ST_EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 indicators[], size_t count)
{
    (void)c, (void)indicators;
    return none(count);
}

ST_EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t count)
{
    size_t i;
    (void)c;
    for (i = 0; i < count; i++) {
        x[i] = 1;
    }
    return count == ST_STATES ? fmi3OK : fmi3Error;
}

ST_EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *count)
{
    (void)c;
    *count = 0;
    return fmi3OK;
}

ST_EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *count)
{
    (void)c;
    *count = ST_STATES;
    return fmi3OK;
}

/* Co-simulation. */

ST_EXPORT fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
    const fmi3Int32 orders[], fmi3Float64 values[], size_t value_count)
{
    (void)c, (void)vr, (void)orders, (void)values, (void)value_count;
    return none(count);
}

ST_EXPORT fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 duration, fmi3Boolean no_set_state,
    fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early_return, fmi3Float64 *last_time)
{
    st_fmu *fmu = fmu_of(c);
    const int result = st_fmu_advance(fmu, time, duration);
    (void)no_set_state;
    *event = *early_return = false;
    *terminate = fmu && fmu->now.terminated != 0;
    *last_time = fmu ? fmu->now.time_s : time;
    return status(result);
}

ST_EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time)
{
    (void)c, (void)clock, (void)time;
    return fmi3Error; /* not supported */
}
