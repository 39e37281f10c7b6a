/* Every function that a tool calls, for the sanitizers: both kinds, saved states, directional derivatives. */
#include "fmi.c"

#include <stdio.h>

static void print(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status level, fmi2String category,
    fmi2String message, ...)
{
    (void)environment, (void)level, (void)category;
    printf("%s: %s\n", name, message);
}

int main(void)
{
    const fmi2CallbackFunctions callbacks = {print, calloc, free, NULL, NULL};
    const fmi2ValueReference unknowns[2] = {1, ST_FIRST_DERIVATIVE + 3}, known = ST_FIRST_STATE + 1;
    const fmi2ValueReference command = ST_FIRST_INPUT, beyond = ST_VALUES;
    const double seed = 1, amperes = 2;
    double values[ST_STATES], sensitivity[2], first;
    fmi2FMUstate saved = NULL, other = NULL;
    fmi2Byte bytes[ST_SERIAL_SIZE];
    fmi2EventInfo info;
    fmi2Boolean event, terminate;
    size_t size;
    int failures = 0, k;
    fmi2Component c = fmi2Instantiate("a", fmi2CoSimulation, ST_TOKEN, "", &callbacks, 0, 0);
    failures += fmi2Instantiate("b", fmi2CoSimulation, "wrong", "", &callbacks, 0, 0) != NULL;
    failures += !c || fmi2SetupExperiment(c, 0, 0, 0, 0, 0) || fmi2EnterInitializationMode(c);
    failures += fmi2ExitInitializationMode(c) || fmi2SetReal(c, &command, 1, &amperes);
    failures += fmi2GetReal(c, &beyond, 1, values) != fmi2Error;
    for (k = 0; k < 100; k++) {
        failures += fmi2DoStep(c, k * 1e-3, 1e-3, 1) != fmi2OK;
    }
    failures += fmi2GetFMUstate(c, &saved) || fmi2SerializedFMUstateSize(c, saved, &size) || size > sizeof bytes;
    failures += fmi2SerializeFMUstate(c, saved, bytes, size) || fmi2DeSerializeFMUstate(c, bytes, size, &other);
    failures += fmi2GetReal(c, unknowns, 1, &first) || fmi2DoStep(c, 0.1, 1e-3, 1) || fmi2SetFMUstate(c, other);
    failures += fmi2GetReal(c, unknowns, 1, values) || values[0] < first || values[0] > first;
    failures += fmi2GetDirectionalDerivative(c, unknowns, 2, &known, 1, &seed, sensitivity) != fmi2OK;
    failures += fmi2FreeFMUstate(c, &saved) || fmi2FreeFMUstate(c, &other) || saved || other;
    failures += fmi2EnterEventMode(c) || fmi2NewDiscreteStates(c, &info) || fmi2EnterContinuousTimeMode(c);
    failures += fmi2SetTime(c, 0.2) || fmi2GetContinuousStates(c, values, ST_STATES);
    failures += fmi2SetContinuousStates(c, values, ST_STATES) || fmi2GetDerivatives(c, values, ST_STATES);
    failures += fmi2GetNominalsOfContinuousStates(c, values, ST_STATES) != fmi2OK;
    failures += fmi2CompletedIntegratorStep(c, 1, &event, &terminate) || event || terminate;
    failures += fmi2Terminate(c) || fmi2Reset(c);
    fmi2FreeInstance(c);
    return failures;
}
