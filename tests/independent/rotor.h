/* Spherical actuator of its own, independent of the package: the attitude is a rotation matrix, integrated with
 * the Euler equations in the rotor's frame (the package: hinge angles), the torque curve is interpolated with
 * cubics through four samples (the package: splines in the cosine), friction is a hyperbolic tangent of the rate
 * (the package: a root) and acts within the step.
 *
 * Settings are texts NAME=VALUE[,VALUE...]: one value counts for all places. `at=T` stands before settings that
 * take effect at the time T, s. */



#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { GROUPS = 18, POLES = 16, STEPS = 4 };

static const double PERIOD_S = 1e-3, STEP_S = 1e-3 / STEPS, RADIAN = 57.29577951308232;
static const double BARE_J[3] = {2.219e-3, 2.176e-3, 2.256e-3}, HEIGHT_M = 0.1, GRAVITY = 9.81;

/* Parameters; torques in N m on the hinges, angles in rad, rates in rad/s. */
static double inertia[3] = {1, 1, 1}, viscous[3], coulomb[3], load[3], payload_kg, lag_s[1] = {0.9e-3 / 1.3};
static double torque[1] = {1}, gain[GROUPS], cogging[1], offset[3], noise[3], count[3], seed[1] = {1}, transition[1] = {0.008};
static double amplitude[3] = {0.2, 0.2, 0.2}, frequency[3] = {0.5, 0.5, 0.5}, payload[1];

static const struct { const char *name; double *values; int places; } SETTINGS[] = {
    {"inertia", inertia, 3}, {"viscous", viscous, 3}, {"coulomb", coulomb, 3}, {"load", load, 3},
    {"payload", payload, 1}, {"lag", lag_s, 1}, {"torque", torque, 1}, {"gain", gain, GROUPS},
    {"cogging", cogging, 1}, {"offset", offset, 3}, {"noise", noise, 3}, {"count", count, 3},
    {"seed", seed, 1}, {"amplitude", amplitude, 3}, {"frequency", frequency, 3},
    {"transition", transition, 1}};

static struct { double t_s; char *text; } later[64];
static int waiting;

/* A setting without `=` or of another name returns 0. `gain=3:0.8` means one place. */
static int set(const char *text)
{
    const char *value = strchr(text, '=');
    for (size_t i = 0; value && i < sizeof SETTINGS / sizeof *SETTINGS; i++) {
        size_t length = strlen(SETTINGS[i].name);
        if (length != (size_t)(value - text) || strncmp(text, SETTINGS[i].name, length)) continue;
        const char *colon = strchr(value, ':');
        int first = colon ? atoi(value + 1) : 0, last = colon ? first + 1 : SETTINGS[i].places;
        const char *at = colon ? colon + 1 : value + 1;
        for (int place = first; place < last; place++) {
            SETTINGS[i].values[place] = atof(at);
            if (strchr(at, ',')) at = strchr(at, ',') + 1;
        }
        payload_kg = payload[0];
        return 1;
    }
    return 0;
}

static int settings(int number, char **texts)
{
    double t_s = -1;
    for (int j = 0; j < GROUPS; j++) gain[j] = 1;
    for (int i = 0; i < number; i++) {
        if (!strncmp(texts[i], "at=", 3)) t_s = atof(texts[i] + 3);
        else if (t_s >= 0 && waiting < 64) later[waiting].t_s = t_s, later[waiting++].text = texts[i];
        else if (!set(texts[i])) return 0;
    }
    return 1;
}

static void take_effect(double t_s)
{
    for (int i = 0; i < waiting; i++)
        if (later[i].text && t_s >= later[i].t_s) set(later[i].text), later[i].text = NULL;
}

static double curve[1024]; /* every 0.25 degrees from 0 */
static int samples;
static double R[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, w[3], current[GROUPS];

static int read_curve(const char *path)
{
    char line[256];
    double deg;
    FILE *file = fopen(path, "r");
    if (!file) return 0;
    while (samples < 1024 && fgets(line, sizeof line, file))
        if (sscanf(line, "%lf,%lf", &deg, &curve[samples]) == 2) samples++;
    fclose(file);
    return samples > 3;
}

static double f(double deg)
{
    double x = deg / 0.25;
    int i = (int)x;
    if (i < 1) i = 1;
    if (i > samples - 3) i = samples - 3;
    double t = x - i, a = curve[i - 1], b = curve[i], c = curve[i + 1], d = curve[i + 2];
    return b + t * (c - a / 3 - b / 2 - d / 6 + t * ((a + c) / 2 - b + t * ((d - a) / 6 + (b - c) / 2)));
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++) out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void axis(double latitude, double longitude, double out[3])
{
    out[0] = cos(latitude / RADIAN) * cos(longitude / RADIAN);
    out[1] = cos(latitude / RADIAN) * sin(longitude / RADIAN);
    out[2] = sin(latitude / RADIAN);
}

/* Torque of one ampere in a group, in the rotor's frame: the 36 coils turn around the rotor. */
static void group_torque(int group, double column[3])
{
    static double coil[GROUPS][3], pole_axis[POLES][3];
    static int is_ready;
    double s_R[3], normal[3];
    if (!is_ready) {
        for (int j = 0; j < GROUPS; j++) axis(j < 12 ? 28 : 0, 30.0 * (j % 12), coil[j]);
        for (int p = 0; p < POLES; p++) axis(p < POLES / 2 ? 18 : -18, 45.0 * (p % 8), pole_axis[p]);
        is_ready = 1;
    }
    for (int i = 0; i < 3; i++)
        s_R[i] = R[0][i] * coil[group][0] + R[1][i] * coil[group][1] + R[2][i] * coil[group][2];
    column[0] = column[1] = column[2] = 0;
    for (int p = 0; p < POLES; p++) {
        cross(pole_axis[p], s_R, normal);
        double sine = sqrt(dot(normal, normal)), deg = RADIAN * atan2(sine, dot(pole_axis[p], s_R));
        if (sine < 1e-9) continue;
        double pull = (p % 2 ? -1 : 1) * (f(deg) - f(180 - deg)) / sine; /* of the coil and the opposite one */
        for (int i = 0; i < 3; i++) column[i] += pull * normal[i];
    }
}

static void angles(double q[3])
{
    q[0] = atan2(-R[1][2], R[2][2]), q[1] = asin(R[0][2]), q[2] = atan2(-R[0][1], R[0][0]);
}

/* Axes of the hinges in the rotor's frame, and their dual basis: a rate is its dual axis times the rates, and a
 * torque on a hinge is one about its dual axis. */
static void hinges(double axes[3][3], double dual[3][3])
{
    double gamma = atan2(-R[0][1], R[0][0]), side[3] = {sin(gamma), cos(gamma), 0}, spin[3] = {0, 0, 1};
    memcpy(axes[0], R[0], sizeof R[0]), memcpy(axes[1], side, sizeof side), memcpy(axes[2], spin, sizeof spin);
    for (int i = 0; i < 3; i++) {
        cross(axes[(i + 1) % 3], axes[(i + 2) % 3], dual[i]);
        double volume = dot(axes[i], dual[i]);
        for (int k = 0; k < 3; k++) dual[i][k] /= volume;
    }
}

/* Everything but the coils, in the rotor's frame: friction, load and cogging on the hinges, weight. */
static void passive_torque(double out[3])
{
    double axes[3][3], dual[3][3], q[3];
    angles(q), hinges(axes, dual);
    double cog[3] = {sin(6 * q[0]) * cos(8 * q[2]), sin(6 * q[1]) * cos(8 * q[2]), sin(8 * q[2])};
    out[0] = payload_kg * GRAVITY * HEIGHT_M * R[2][1], out[1] = -payload_kg * GRAVITY * HEIGHT_M * R[2][0];
    out[2] = 0;
    for (int i = 0; i < 3; i++) {
        double rate = dot(dual[i], w);
        double on_hinge = load[i] + cogging[0] * cog[i] - viscous[i] * rate - coulomb[i] * tanh(rate / transition[0]);
        for (int k = 0; k < 3; k++) out[k] += on_hinge * dual[i][k];
    }
}

/* Exact rotation by a vector (Rodrigues), on the right: the vector is in the rotor's frame. */
static void turn(const double by[3])
{
    double angle = sqrt(dot(by, by));
    if (angle < 1e-15) return;
    double n[3] = {by[0] / angle, by[1] / angle, by[2] / angle};
    for (int row = 0; row < 3; row++) {
        double v[3] = {R[row][0], R[row][1], R[row][2]}, c[3], along = dot(v, n);
        cross(v, n, c); /* row times the matrix of the rotation */
        for (int i = 0; i < 3; i++) R[row][i] = v[i] * cos(angle) + c[i] * sin(angle) + n[i] * along * (1 - cos(angle));
    }
}

/* A physics step: half a turn, rates with the torque in the middle, half a turn. */
static void step(const double command[GROUPS])
{
    double applied[3], column[3], Jw[3], J[3], gyro[3], half[3];
    for (int j = 0; j < GROUPS; j++) current[j] += (command[j] - current[j]) * -expm1(-STEP_S / lag_s[0]);
    for (int i = 0; i < 3; i++) half[i] = 0.5 * STEP_S * w[i];
    turn(half);
    passive_torque(applied);
    for (int j = 0; j < GROUPS; j++) {
        if (current[j] == 0) continue;
        group_torque(j, column);
        for (int i = 0; i < 3; i++) applied[i] += torque[0] * gain[j] * current[j] * column[i];
    }
    for (int i = 0; i < 3; i++) {
        J[i] = inertia[i] * BARE_J[i] + (i < 2 ? payload_kg * HEIGHT_M * HEIGHT_M : 0);
        Jw[i] = J[i] * w[i];
    }
    cross(w, Jw, gyro);
    for (int i = 0; i < 3; i++) w[i] += STEP_S * (applied[i] - gyro[i]) / J[i];
    for (int i = 0; i < 3; i++) half[i] = 0.5 * STEP_S * w[i];
    turn(half);
}

static uint64_t state;

static double uniform(void) /* xorshift64*, above 0 */
{
    if (!state) state = 88172645463325252u ^ (uint64_t)seed[0] * 2654435761u;
    state ^= state >> 12, state ^= state << 25, state ^= state >> 27;
    return ((double)(state * 2685821657736338717u >> 11) + 0.5) / 9007199254740992.0;
}

static double normal(void) { return sqrt(-2 * log(uniform())) * cos(8 * atan(1.0) * uniform()); }

/* What the sensors report: offset and noise, then the nearest count. */
static void sense(double q[3])
{
    angles(q);
    for (int i = 0; i < 3; i++) {
        q[i] += offset[i] + (noise[i] > 0 ? noise[i] * normal() : 0);
        if (count[i] > 0) q[i] = count[i] * floor(q[i] / count[i] + 0.5);
    }
}
