/* Every function that a tool calls, for the sanitizers: both kinds, saved states, directional derivatives. */
#include "fmi.c"

#include <stdio.h>

static void print(fmi3InstanceEnvironment environment, fmi3Status level, fmi3String category, fmi3String message)
{
    (void)environment, (void)level, (void)category;
    puts(message);
}

int main(void)
{
    const fmi3ValueReference unknowns[2] = {1, ST_FIRST_DERIVATIVE + 3}, known = ST_FIRST_STATE + 1;
    const fmi3ValueReference command = ST_FIRST_INPUT, beyond = ST_VALUES;
    const double seed = 1, amperes = 2;
    double values[ST_STATES], sensitivity[2], first, last;
    fmi3FMUState saved = NULL, other = NULL;
    fmi3Byte bytes[ST_SERIAL_SIZE];
    bool a, b, d;
    size_t size;
    int failures = 0, k;
    fmi3Instance c
        = fmi3InstantiateCoSimulation("a", ST_TOKEN, "", false, false, false, false, NULL, 0, NULL, print, NULL);
    failures += fmi3InstantiateModelExchange("b", "wrong", "", false, false, NULL, print) != NULL;
    failures += !c || fmi3EnterInitializationMode(c, false, 0, 0, false, 0) || fmi3ExitInitializationMode(c);
    failures += fmi3SetFloat64(c, &command, 1, &amperes, 1) != fmi3OK;
    failures += fmi3GetFloat64(c, &beyond, 1, values, 1) != fmi3Error;
    for (k = 0; k < 100; k++) {
        failures += fmi3DoStep(c, k * 1e-3, 1e-3, true, &a, &b, &d, &last) != fmi3OK || b;
    }
    failures += fmi3GetFMUState(c, &saved) || fmi3SerializedFMUStateSize(c, saved, &size) || size > sizeof bytes;
    failures += fmi3SerializeFMUState(c, saved, bytes, size) || fmi3DeserializeFMUState(c, bytes, size, &other);
    failures += fmi3GetFloat64(c, unknowns, 1, &first, 1) || fmi3DoStep(c, 0.1, 1e-3, true, &a, &b, &d, &last);
    failures += fmi3SetFMUState(c, other) || fmi3GetFloat64(c, unknowns, 1, values, 1);
    failures += values[0] < first || values[0] > first;
    failures += fmi3GetDirectionalDerivative(c, unknowns, 2, &known, 1, &seed, 1, sensitivity, 2) != fmi3OK;
    failures += fmi3FreeFMUState(c, &saved) || fmi3FreeFMUState(c, &other) || saved || other;
    failures += fmi3EnterEventMode(c) || fmi3UpdateDiscreteStates(c, &a, &a, &a, &a, &a, &last) || a;
    failures += fmi3EnterContinuousTimeMode(c) || fmi3SetTime(c, 0.2);
    failures += fmi3GetNumberOfContinuousStates(c, &size) || size != ST_STATES;
    failures += fmi3GetContinuousStates(c, values, size) || fmi3SetContinuousStates(c, values, size);
    failures += fmi3GetContinuousStateDerivatives(c, values, size) != fmi3OK;
    failures += fmi3GetNominalsOfContinuousStates(c, values, size) != fmi3OK;
    failures += fmi3CompletedIntegratorStep(c, true, &a, &b) || a || b;
    failures += fmi3Terminate(c) || fmi3Reset(c);
    fmi3FreeInstance(c);
    return failures;
}
