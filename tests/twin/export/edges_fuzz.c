/* Fuzz target of all compiled edges of an export: plant, control tick and FMI 3.0.
 *
 * The bytes of an input select calls and their numbers, extreme ones above all. The target aborts if a call breaks a
 * promise: a refused call changes nothing, an accepted one leaves finite numbers within their bounds.
 *
 * A coverage-guided fuzzer calls LLVMFuzzerTestOneInput: `make fuzz`. With ST_DRAWS the program has its own main:
 * `edges_fuzz SEED DRAWS` makes inputs from a seed, `edges_fuzz FILE...` repeats inputs.
 */
#include "fmi.c"

#include <math.h>
#include <stdio.h>

#include "st_controller.h"
#include "st_plant_bounds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const uint8_t *bytes;
static size_t left;

static unsigned byte(void)
{
    if (!left) {
        return 0;
    }
    left--;
    return *bytes++;
}

static void promise(int kept, const char *text)
{
    if (!kept) {
        (void)fprintf(stderr, "broken promise: %s\n", text);
        abort();
    }
}

static int all_finite(const double *values, int count)
{
    int i;
    for (i = 0; i < count; i++) {
        if (!(fabs(values[i]) < HUGE_VAL)) {
            return 0;
        }
    }
    return 1;
}

/* A number: plain, at or next to a bound, extreme, or any bits. */
static double number(const double bounds[2])
{
    static const double extreme[] = {0, -0.0, 5e-324, 1e-300, 1e-12, 1e-9, 1e-6, 1e-3, 0.5, 1, 7, 100, 1e6, 1e15, 1e18,
        1e30, 1e100, 1e200, 1e300, 1.7e308};
    const unsigned choice = byte(), sign = choice & 1;
    uint64_t bits = 0;
    double value;
    int i;
    switch (choice >> 1 & 7) {
    case 0:
        return sign ? (double)NAN : (double)INFINITY;
    case 1:
        return bounds[sign];
    case 2:
        return nextafter(bounds[sign], sign ? HUGE_VAL : -HUGE_VAL);
    case 3:
    case 4:
        value = extreme[byte() % (sizeof extreme / sizeof *extreme)];
        return sign ? -value : value;
    case 5:
        for (i = 0; i < 8; i++) {
            bits = bits << 8 | byte();
        }
        memcpy(&value, &bits, sizeof value);
        return value;
    default:
        return ((int)byte() - 128) / 64.0;
    }
}

static const double ANY[2] = {-1.7e308, 1.7e308};

static double duration_of(double step_s)
{
    static const double range[2] = {ST_SHORTEST_S, 1};
    const double duration = number(range);
    /* Longer ones are accepted up to ST_MOST_STEPS_A_CALL steps: that would take seconds. */
    return duration > 50 * step_s && duration <= ST_MOST_STEPS_A_CALL * step_s ? 50 * step_s : duration;
}

static void use_plant(void)
{
    st_parameters parameters;
    st_plant plant, before;
    double x[ST_STATES], input[ST_INPUTS] = {0}, result[ST_STATES], kept[ST_STATES], reached = -1;
    double *values = (double *)&parameters;
    double x_direction[ST_STATES] = {0}, input_direction[ST_INPUTS] = {0};
    int calls, verdict, advances, i;
    st_plant_defaults(&parameters, x);
    promise(st_plant_start(&plant, x) == ST_OK, "the defaults are valid");
    for (calls = 0; calls < 24 && left; calls++) {
        const unsigned call = byte() % 10;
        before = plant;
        if (call == 0) {
            const unsigned at = byte() % ST_PARAMETERS;
            values[at] = number(ST_PARAMETER_BOUNDS[at]);
        } else if (call == 1) {
            const unsigned at = byte() % ST_INPUTS;
            input[at] = number(ST_INPUT_BOUNDS[at]);
            input_direction[at] = number(ANY);
        } else if (call == 2) {
            const unsigned at = byte() % ST_STATES;
            plant.x[at] = number(ST_STATE_BOUNDS[at]);
            x_direction[at] = number(ANY);
        } else if (call == 3) {
            ((double *)&plant)[byte() % (sizeof plant / sizeof(double))] = number(ANY);
        } else if (call == 4) {
            st_plant_defaults(&parameters, x);
            (void)st_plant_start(&plant, x);
        } else if (call < 8) {
            advances = call == 5;
            verdict = advances ? st_plant_advance(&parameters, input, &plant, duration_of(parameters.step_s), &reached)
                               : st_plant_step(&parameters, input, &plant, duration_of(1));
            if (verdict == ST_OK || verdict == ST_LEFT_WORKSPACE) {
                promise(all_finite((const double *)&plant, sizeof plant / sizeof(double)), "a step gives finite states");
                promise(st_plant_check(&parameters, input, &plant) == ST_OK, "a step gives states within their bounds");
                promise(!advances || reached > 0, "an advance takes time");
            } else {
                promise(!memcmp(&plant, &before, sizeof plant), "a refused step changes nothing");
                promise(!advances || !(reached > 0 || reached < 0), "a refused advance takes no time");
            }
        } else {
            for (i = 0; i < ST_STATES; i++) {
                result[i] = kept[i] = 12345;
            }
            verdict = call == 8
                ? st_plant_derivatives(&parameters, input, plant.x, result)
                : st_plant_directional(&parameters, input, plant.x, input_direction, x_direction, result);
            promise(verdict ? !memcmp(result, kept, sizeof kept) : all_finite(result, ST_STATES),
                "derivatives are finite or not written");
        }
    }
}

static void use_controller(void)
{
    static const double range[2] = {-1.5, 1.5};
    st_controller controller, before;
    st_real reference[3][3] = {{0}}, angle[3] = {0}, rate[3] = {0}, command[ST_GROUPS], share;
    int calls, i;
    memset(&controller, 0, sizeof controller);
    st_controller_start(&controller);
    for (calls = 0; calls < 60 && left; calls++) {
        const unsigned place = byte() % 20;
        st_real *changed = place < 9 ? &reference[place / 3][place % 3]
            : place < 12             ? &angle[place - 9]
            : place < 15             ? &rate[place - 12]
                                     : NULL;
        const st_real kept = changed ? *changed : 0;
        if (changed) {
            const double value = number(range);
            *changed = fabs(value) <= 1e38 || sizeof(st_real) == sizeof(double) ? (st_real)value : (st_real)INFINITY;
        }
        memcpy(&before, &controller, sizeof before);
        share = st_controller_tick(&controller, (const st_real(*)[3])reference, angle, rate, command);
        promise(share <= 1 && (share >= 0 || !(share > -1 || share < -1)), "the share is -1 or within 0 and 1");
        for (i = 0; i < ST_GROUPS; i++) {
            promise(fabs((double)command[i]) <= (share < 0 ? 0 : 1e3), "commands are finite, and 0 if refused");
        }
        if (share < 0) {
            promise(!memcmp(&controller, &before, sizeof before), "a refused tick changes nothing");
            if (changed) {
                *changed = kept;
            }
        }
    }
}

static void use_fmu(void)
{
    bool a, b, d;
    double time_s = 0, values[2], last;
    fmi3ValueReference references[2];
    fmi3FMUState saved = NULL;
    fmi3Byte content[ST_SERIAL_SIZE];
    size_t i;
    int calls;
    fmi3Instance c = fmi3InstantiateModelExchange("a", ST_TOKEN, "", false, false, NULL, NULL);
    promise(c && fmi3EnterInitializationMode(c, false, 0, 0, false, 0) == fmi3OK, "an instance initialises");
    for (calls = 0; calls < 24 && left; calls++) {
        st_fmu *fmu = fmu_of(c);
        const st_fmu before = *fmu;
        const unsigned call = byte() % 9;
        fmi3Status status_of_call = fmi3OK;
        if (call < 2) {
            for (i = 0; i < 2; i++) {
                references[i] = byte() | (fmi3ValueReference)(byte() & 1) << 8;
                values[i] = number(ANY);
            }
            status_of_call = fmi3SetFloat64(c, references, 1 + call, values, 1 + call);
        } else if (call == 2) {
            status_of_call = fmi3DoStep(c, time_s, duration_of(fmu->now.parameters.step_s), true, &a, &b, &d, &last);
            promise(status_of_call != fmi3OK || b || last >= time_s, "time does not go back");
            time_s = fmu->now.time_s;
        } else if (call == 3) {
            double x[ST_STATES];
            memcpy(x, fmu->now.plant.x, sizeof x);
            x[byte() % ST_STATES] = number(ANY);
            status_of_call = fmi3SetContinuousStates(c, x, ST_STATES);
        } else if (call == 4) {
            double x[ST_STATES];
            if (fmi3GetContinuousStateDerivatives(c, x, ST_STATES) == fmi3OK) {
                promise(all_finite(x, ST_STATES), "derivatives are finite");
            }
        } else if (call == 5) {
            status_of_call = byte() & 1 ? fmi3ExitInitializationMode(c) : fmi3SetTime(c, number(ANY));
        } else if (call == 6) {
            references[0] = byte();
            references[1] = byte() % (ST_VALUES + 1);
            if (fmi3GetFloat64(c, references, 2, values, 2) == fmi3OK) {
                promise(all_finite(values, 2), "values are finite");
            }
        } else if (call == 7) {
            const fmi3ValueReference unknowns[2] = {ST_FIRST_DERIVATIVE + byte() % ST_STATES, ST_FIRST_STATE};
            references[0] = byte();
            values[0] = number(ANY);
            if (fmi3GetDirectionalDerivative(c, unknowns, 2, references, 1, values, 1, values, 2) == fmi3OK) {
                promise(all_finite(values, 2), "directional derivatives are finite");
            }
        } else {
            promise(fmi3GetFMUState(c, &saved) == fmi3OK
                    && fmi3SerializeFMUState(c, saved, content, sizeof content) == fmi3OK,
                "a state can be saved");
            i = byte() | (size_t)byte() << 8;
            content[i % sizeof content] ^= (fmi3Byte)byte();
            if (fmi3DeserializeFMUState(c, content, sizeof content, &saved) == fmi3OK) {
                status_of_call = fmi3SetFMUState(c, saved);
            }
        }
        promise(status_of_call == fmi3OK || !memcmp(fmu, &before, sizeof before), "a refused call changes nothing");
        promise(all_finite((const double *)&fmu->now, sizeof fmu->now / sizeof(double)), "an instance is finite");
    }
    (void)fmi3FreeFMUState(c, &saved);
    fmi3FreeInstance(c);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    unsigned edge;
    bytes = data;
    left = size;
    edge = byte() % 3;
    if (edge == 0) {
        use_plant();
    } else if (edge == 1) {
        use_controller();
    } else {
        use_fmu();
    }
    return 0;
}

#ifdef ST_DRAWS
static void repeat(const char *path)
{
    static uint8_t content[1 << 16];
    FILE *file = fopen(path, "rb");
    if (file) {
        (void)LLVMFuzzerTestOneInput(content, fread(content, 1, sizeof content, file));
        (void)fclose(file);
    }
}

int main(int count, char **arguments)
{
    char *end = NULL;
    uint64_t state = count == 3 ? strtoull(arguments[1], &end, 10) : 0;
    long draws = end && !*end ? strtol(arguments[2], NULL, 10) : 0;
    uint8_t content[512];
    int i;
    for (i = 1; i < count && !draws; i++) {
        repeat(arguments[i]);
    }
    for (; draws > 0; draws--) {
        size_t k;
        for (k = 0; k < sizeof content; k++) { /* splitmix64 */
            uint64_t z = state += UINT64_C(0x9e3779b97f4a7c15);
            z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
            z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
            content[k] = (uint8_t)(z >> 32);
        }
        (void)LLVMFuzzerTestOneInput(content, sizeof content);
    }
    return 0;
}
#endif
