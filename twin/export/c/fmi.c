/* SPDX-License-Identifier: MIT */
/* Functional Mock-up Interface, version ST_FMI (2 or 3): co-simulation and model exchange.
 *
 * FMI(name) is the name of a function or a type in this version. A function that only returns a result is an
 * ST_FUNCTION. The interface has parameters that a plant does not need.
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "st_fmu.h"
#include "st_fmu_token.h" /* generated: ST_FMI and ST_TOKEN */

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define ST_FUNCTION(name, parameters, result)                                                                    \
    ST_EXPORT FMI(Status) name parameters                                                                        \
    {                                                                                                            \
        return result;                                                                                           \
    }

#if ST_FMI == 2
#define FMI(name) fmi2##name
#define FMI_STATE(verb) fmi2##verb##FMUstate
#define ST_STATE_SIZE fmi2SerializedFMUstateSize
#define ST_DESERIALISE fmi2DeSerializeFMUstate
#define ST_DERIVATIVES fmi2GetDerivatives
#define ST_VERSION "2.0"
#define ST_VALUE_COUNT
#ifdef ST_STANDARD_HEADERS
#include "fmi2Functions.h"
#else
typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef char fmi2Char, fmi2Byte;
typedef const fmi2Char *fmi2String;
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
typedef fmi2Component st_instance;
typedef fmi2FMUstate st_saved;
#else
#define FMI(name) fmi3##name
#define FMI_STATE(verb) fmi3##verb##FMUState
#define ST_STATE_SIZE fmi3SerializedFMUStateSize
#define ST_DESERIALISE fmi3DeserializeFMUState
#define ST_DERIVATIVES fmi3GetContinuousStateDerivatives
#define ST_VERSION "3.0"
#define ST_VALUE_COUNT , size_t value_count
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
typedef fmi3Instance st_instance;
typedef fmi3FMUState st_saved;
#endif

/* Instance: the functions of the interface receive its address. */
typedef struct {
    st_fmu *fmu;
#if ST_FMI == 2
    const fmi2CallbackFunctions *callbacks;
    char name[];
#else
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
#endif
} st_component;

static st_fmu *fmu_of(st_instance c)
{
    return c ? ((st_component *)c)->fmu : NULL;
}

static FMI(Status) status(int result)
{
    return result == ST_FMU_OK ? FMI(OK) : result == ST_FMU_DISCARD ? FMI(Discard) : FMI(Error);
}

static FMI(Status) none(size_t count)
{
    return count ? FMI(Error) : FMI(OK);
}

/* New instance with some more bytes; null without memory. */
static st_component *new_component(size_t more)
{
    st_component *component = calloc(1, sizeof *component + more);
    if (component) {
        component->fmu = st_fmu_new();
        if (!component->fmu) {
            free(component);
            return NULL;
        }
        component->fmu->environment = component;
    }
    return component;
}

ST_EXPORT void FMI(FreeInstance)(st_instance c)
{
    if (c) {
        free(fmu_of(c));
        free(c);
    }
}

ST_EXPORT const char *FMI(GetVersion)(void)
{
    return ST_VERSION;
}

ST_FUNCTION(FMI(SetDebugLogging), (st_instance c, FMI(Boolean) on, size_t count, const FMI(String) names[]), FMI(OK))
ST_FUNCTION(FMI(ExitInitializationMode), (st_instance c), status(st_fmu_start(fmu_of(c))))
ST_FUNCTION(FMI(EnterEventMode), (st_instance c), FMI(OK))
ST_FUNCTION(FMI(EnterContinuousTimeMode), (st_instance c), FMI(OK))
ST_FUNCTION(FMI(Terminate), (st_instance c), FMI(OK))
ST_FUNCTION(FMI(Reset), (st_instance c), c ? (st_fmu_reset(fmu_of(c)), FMI(OK)) : FMI(Error))

/* Saved states. */
ST_FUNCTION(FMI_STATE(Get), (st_instance c, st_saved *saved), status(st_fmu_save(fmu_of(c), saved)))
ST_FUNCTION(FMI_STATE(Set), (st_instance c, st_saved saved), status(st_fmu_restore(fmu_of(c), saved)))
ST_FUNCTION(FMI_STATE(Free), (st_instance c, st_saved *saved), (st_fmu_release(saved), FMI(OK)))
ST_FUNCTION(ST_STATE_SIZE, (st_instance c, st_saved saved, size_t *size), (*size = ST_SERIAL_SIZE, FMI(OK)))
ST_FUNCTION(FMI_STATE(Serialize), (st_instance c, st_saved saved, FMI(Byte) bytes[], size_t size),
    status(st_fmu_serialise(saved, bytes, size)))
ST_FUNCTION(ST_DESERIALISE, (st_instance c, const FMI(Byte) bytes[], size_t size, st_saved *saved),
    status(st_fmu_deserialise(bytes, size, saved)))

/* There are no values of other types. */
#define ST_NO_VALUES(Name)                                                                                       \
    ST_FUNCTION(FMI(Get##Name),                                                                                  \
        (st_instance c, const FMI(ValueReference) vr[], size_t count, FMI(Name) values[] ST_VALUE_COUNT),        \
        none(count))                                                                                             \
    ST_FUNCTION(FMI(Set##Name),                                                                                  \
        (st_instance c, const FMI(ValueReference) vr[], size_t count, const FMI(Name) values[] ST_VALUE_COUNT),  \
        none(count))
ST_NO_VALUES(Boolean)
ST_NO_VALUES(String)

/* Model exchange. */
static FMI(Status) nominals(double x[], size_t count)
{
    size_t i;
    for (i = 0; i < count; i++) {
        x[i] = 1;
    }
    return count == ST_STATES ? FMI(OK) : FMI(Error);
}

ST_FUNCTION(FMI(SetTime), (st_instance c, double time), status(st_fmu_set_time(fmu_of(c), time)))
ST_FUNCTION(FMI(SetContinuousStates), (st_instance c, const double x[], size_t count),
    status(st_fmu_set_states(fmu_of(c), x, count)))
ST_FUNCTION(FMI(GetContinuousStates), (st_instance c, double x[], size_t count),
    status(st_fmu_get_states(fmu_of(c), x, count)))
ST_FUNCTION(ST_DERIVATIVES, (st_instance c, double derivatives[], size_t count),
    status(st_fmu_derivatives(fmu_of(c), derivatives, count)))
ST_FUNCTION(FMI(GetEventIndicators), (st_instance c, double indicators[], size_t count), none(count))
ST_FUNCTION(FMI(GetNominalsOfContinuousStates), (st_instance c, double x[], size_t count), nominals(x, count))
ST_FUNCTION(FMI(CompletedIntegratorStep),
    (st_instance c, FMI(Boolean) no_set_state, FMI(Boolean) *event, FMI(Boolean) *terminate),
    (*event = false, *terminate = st_fmu_outside(fmu_of(c)) != 0, FMI(OK)))

#if ST_FMI == 2
static void send(void *environment, const char *message)
{
    const st_component *component = environment;
    component->callbacks->logger(component->callbacks->componentEnvironment, component->name, fmi2Error,
        "logStatusError", message); /* without conversions */
}

ST_EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

ST_EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String token, fmi2String resources,
    const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    const bool logs = callbacks && callbacks->logger;
    st_component *component;
    if (!name || !token || strcmp(token, ST_TOKEN) != 0) {
        if (logs) {
            callbacks->logger(callbacks->componentEnvironment, name ? name : "?", fmi2Error, "logStatusError",
                "instantiate: expected the guid of this model description");
        }
        return NULL;
    }
    component = new_component(strlen(name) + 1);
    if (component) {
        memcpy(component->name, name, strlen(name) + 1);
        component->callbacks = callbacks;
        component->fmu->log = logs ? send : NULL;
    }
    return component;
}

static fmi2Status no_event(fmi2EventInfo *info)
{
    info->newDiscreteStatesNeeded = info->terminateSimulation = false;
    info->nominalsOfContinuousStatesChanged = info->valuesOfContinuousStatesChanged = false;
    info->nextEventTimeDefined = false;
    info->nextEventTime = 0;
    return fmi2OK;
}

static fmi2Status stepped(const st_fmu *fmu, int result)
{
    return result != ST_FMU_OK ? fmi2Error : fmu->now.terminated != 0 ? fmi2Discard : fmi2OK;
}

ST_NO_VALUES(Integer)
ST_FUNCTION(fmi2SetupExperiment,
    (fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop,
        fmi2Real stop),
    status(st_fmu_set_time(fmu_of(c), start)))
ST_FUNCTION(fmi2EnterInitializationMode, (fmi2Component c), fmi2OK)
ST_FUNCTION(fmi2GetReal, (fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2Real values[]),
    status(st_fmu_get(fmu_of(c), vr, count, values)))
ST_FUNCTION(fmi2SetReal, (fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Real values[]),
    status(st_fmu_set(fmu_of(c), vr, count, values)))
ST_FUNCTION(fmi2GetDirectionalDerivative,
    (fmi2Component c, const fmi2ValueReference unknowns[], size_t unknown_count, const fmi2ValueReference knowns[],
        size_t known_count, const fmi2Real seed[], fmi2Real sensitivity[]),
    status(st_fmu_directional(fmu_of(c), unknowns, unknown_count, knowns, known_count, seed, sensitivity)))
ST_FUNCTION(fmi2NewDiscreteStates, (fmi2Component c, fmi2EventInfo *info), no_event(info))
ST_FUNCTION(fmi2SetRealInputDerivatives,
    (fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Integer order[], const fmi2Real value[]),
    none(count))
ST_FUNCTION(fmi2GetRealOutputDerivatives,
    (fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Integer order[], fmi2Real value[]),
    none(count))
ST_FUNCTION(fmi2DoStep, (fmi2Component c, fmi2Real time, fmi2Real duration, fmi2Boolean no_set_state),
    stepped(fmu_of(c), st_fmu_advance(fmu_of(c), time, duration)))
ST_FUNCTION(fmi2CancelStep, (fmi2Component c), fmi2Error)
ST_FUNCTION(fmi2GetStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Status *value), fmi2Discard)
ST_FUNCTION(fmi2GetIntegerStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value), fmi2Discard)
ST_FUNCTION(fmi2GetStringStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2String *value), fmi2Discard)
ST_FUNCTION(fmi2GetRealStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Real *value),
    c && kind == fmi2LastSuccessfulTime ? (*value = fmu_of(c)->now.time_s, fmi2OK) : fmi2Discard)
ST_FUNCTION(fmi2GetBooleanStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value),
    c && kind == fmi2Terminated ? (*value = fmu_of(c)->now.terminated != 0, fmi2OK) : fmi2Discard)
#else
static void send(void *environment, const char *message)
{
    const st_component *component = environment;
    component->log(component->environment, fmi3Error, "logStatusError", message);
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
    component = new_component(0);
    if (component) {
        component->environment = environment;
        component->log = log;
        component->fmu->log = log ? send : NULL;
    }
    return component;
}

ST_EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    return instantiate(token, environment, log);
}

ST_EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
    const fmi3ValueReference required[], size_t count, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    return instantiate(token, environment, log);
}

ST_EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    return NULL; /* not supported */
}

ST_FUNCTION(fmi3EnterInitializationMode,
    (fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean has_stop,
        fmi3Float64 stop),
    status(st_fmu_set_time(fmu_of(c), start)))
ST_FUNCTION(fmi3EnterStepMode, (fmi3Instance c), fmi3OK)
ST_FUNCTION(fmi3EvaluateDiscreteStates, (fmi3Instance c), fmi3OK)
ST_FUNCTION(fmi3EnterConfigurationMode, (fmi3Instance c), fmi3Error) /* there are no structural parameters */
ST_FUNCTION(fmi3ExitConfigurationMode, (fmi3Instance c), fmi3Error)
ST_FUNCTION(fmi3GetFloat64,
    (fmi3Instance c, const fmi3ValueReference vr[], size_t count, fmi3Float64 values[], size_t value_count),
    status(count == value_count ? st_fmu_get(fmu_of(c), vr, count, values) : ST_FMU_ERROR))
ST_FUNCTION(fmi3SetFloat64,
    (fmi3Instance c, const fmi3ValueReference vr[], size_t count, const fmi3Float64 values[], size_t value_count),
    status(count == value_count ? st_fmu_set(fmu_of(c), vr, count, values) : ST_FMU_ERROR))
ST_NO_VALUES(Float32)
ST_NO_VALUES(Int8)
ST_NO_VALUES(UInt8)
ST_NO_VALUES(Int16)
ST_NO_VALUES(UInt16)
ST_NO_VALUES(Int32)
ST_NO_VALUES(UInt32)
ST_NO_VALUES(Int64)
ST_NO_VALUES(UInt64)

/* There are no binary values and no clocks. */
#define ST_NOTHING(name, ...)                                                                                    \
    ST_FUNCTION(name, (fmi3Instance c, const fmi3ValueReference vr[], size_t count, __VA_ARGS__), none(count))
ST_NOTHING(fmi3GetBinary, size_t sizes[], fmi3Binary values[], size_t value_count)
ST_NOTHING(fmi3SetBinary, const size_t sizes[], const fmi3Binary values[], size_t value_count)
ST_NOTHING(fmi3GetClock, fmi3Clock values[])
ST_NOTHING(fmi3SetClock, const fmi3Clock values[])
ST_NOTHING(fmi3GetShiftDecimal, fmi3Float64 shifts[])
ST_NOTHING(fmi3SetShiftDecimal, const fmi3Float64 shifts[])
ST_NOTHING(fmi3SetIntervalDecimal, const fmi3Float64 intervals[])
ST_NOTHING(fmi3GetIntervalDecimal, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
ST_NOTHING(fmi3GetShiftFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
ST_NOTHING(fmi3SetShiftFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ST_NOTHING(fmi3SetIntervalFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ST_NOTHING(fmi3GetIntervalFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
    fmi3IntervalQualifier qualifiers[])
ST_NOTHING(fmi3GetOutputDerivatives, const fmi3Int32 orders[], fmi3Float64 values[], size_t value_count)

/* Not supported. */
ST_FUNCTION(fmi3GetNumberOfVariableDependencies, (fmi3Instance c, fmi3ValueReference vr, size_t *count), fmi3Error)
ST_FUNCTION(fmi3GetVariableDependencies,
    (fmi3Instance c, fmi3ValueReference dependent, size_t elements[], fmi3ValueReference independents[],
        size_t independent_elements[], fmi3DependencyKind kinds[], size_t count),
    fmi3Error)
ST_FUNCTION(fmi3GetAdjointDerivative,
    (fmi3Instance c, const fmi3ValueReference unknowns[], size_t unknown_count, const fmi3ValueReference knowns[],
        size_t known_count, const fmi3Float64 seed[], size_t seed_count, fmi3Float64 sensitivity[],
        size_t sensitivity_count),
    fmi3Error)
ST_FUNCTION(fmi3ActivateModelPartition, (fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time), fmi3Error)

ST_FUNCTION(fmi3GetDirectionalDerivative,
    (fmi3Instance c, const fmi3ValueReference unknowns[], size_t unknown_count, const fmi3ValueReference knowns[],
        size_t known_count, const fmi3Float64 seed[], size_t seed_count, fmi3Float64 sensitivity[],
        size_t sensitivity_count),
    seed_count != known_count || sensitivity_count != unknown_count
        ? fmi3Error
        : status(st_fmu_directional(fmu_of(c), unknowns, unknown_count, knowns, known_count, seed, sensitivity)))
ST_FUNCTION(fmi3UpdateDiscreteStates,
    (fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *new_nominals, fmi3Boolean *new_states,
        fmi3Boolean *has_next, fmi3Float64 *next),
    (*again = *terminate = *new_nominals = *new_states = *has_next = false, *next = 0, fmi3OK))
ST_FUNCTION(fmi3GetNumberOfEventIndicators, (fmi3Instance c, size_t *count), (*count = 0, fmi3OK))
ST_FUNCTION(fmi3GetNumberOfContinuousStates, (fmi3Instance c, size_t *count), (*count = ST_STATES, fmi3OK))

ST_EXPORT fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 duration, fmi3Boolean no_set_state,
    fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early_return, fmi3Float64 *last_time)
{
    st_fmu *fmu = fmu_of(c);
    const int result = st_fmu_advance(fmu, time, duration);
    *event = *early_return = false;
    *terminate = fmu && fmu->now.terminated != 0;
    *last_time = fmu ? fmu->now.time_s : time;
    return status(result);
}
#endif
