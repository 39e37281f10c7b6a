/* Firmware of a spherical actuator with a plant of its own, independent of the package: the attitude is a
 * rotation matrix, integrated with the Euler equations in the rotor's frame (the package: hinge angles), and
 * the torque curve is interpolated with cubics through four samples (the package: splines in the cosine).
 *
 *   firmware torque_curve.csv [NOISE_URAD [FAULT TICK]]
 *
 * It prints the port, then answers each command over UDP until END. The noise of the angles has this standard
 * deviation. From a tick on it has a fault: `frozen` angles, bit for bit; a `stuck` sensor, with its noise; a
 * `reversed` third angle; a rotor whose coils have no torque, `limp`; 1.2 of the torque, `strong`.
 *
 * Frames as in firmware.toml: big-endian, angles in microradians, currents in milliamperes, CRC-16, CR LF. */

#define _POSIX_C_SOURCE 200809L

#include <arpa/inet.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>

enum { GROUPS = 18, POLES = 16, STEPS = 4, ARMED = 1, HELLO = 2, END = 4 };

static const double STEP_S = 1e-3 / STEPS, LAG_S = 0.9e-3 / 1.3, RADIAN = 57.29577951308232;
static const double J[3] = {2.22e-3, 2.18e-3, 2.26e-3}, VISCOUS_NMS = 1e-4;

static double curve[1024]; /* every 0.25 degrees from 0 */
static int samples;
static double R[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, w[3], current[GROUPS];

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

/* Torque of the coils in the rotor's frame: the 36 coils turn around the rotor. */
static void coil_torque(double torque[3])
{
    torque[0] = torque[1] = torque[2] = 0;
    for (int coil = 0; coil < 2 * GROUPS; coil++) {
        int group = coil % GROUPS;
        double s[3], s_R[3];
        axis(group < 12 ? 28 : 0, 30.0 * (group % 12), s);
        for (int i = 0; i < 3; i++)
            s_R[i] = (coil < GROUPS ? 1 : -1) * (R[0][i] * s[0] + R[1][i] * s[1] + R[2][i] * s[2]);
        for (int pole = 0; pole < POLES; pole++) {
            double r[3], normal[3];
            axis(pole < POLES / 2 ? 18 : -18, 45.0 * (pole % 8), r);
            cross(r, s_R, normal);
            double sine = sqrt(dot(normal, normal));
            if (sine < 1e-9) continue;
            double pull = (pole % 2 ? -1 : 1) * current[group] * f(RADIAN * atan2(sine, dot(r, s_R))) / sine;
            for (int i = 0; i < 3; i++) torque[i] += pull * normal[i];
        }
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
    double torque[3], Jw[3], gyro[3], half[3];
    for (int j = 0; j < GROUPS; j++) current[j] += (command[j] - current[j]) * -expm1(-STEP_S / LAG_S);
    for (int i = 0; i < 3; i++) half[i] = 0.5 * STEP_S * w[i];
    turn(half);
    coil_torque(torque);
    for (int i = 0; i < 3; i++) Jw[i] = J[i] * w[i];
    cross(w, Jw, gyro);
    for (int i = 0; i < 3; i++) w[i] += STEP_S * (torque[i] - gyro[i] - VISCOUS_NMS * w[i]) / J[i];
    for (int i = 0; i < 3; i++) half[i] = 0.5 * STEP_S * w[i];
    turn(half);
}

static uint16_t crc16(const unsigned char *bytes, int count)
{
    uint16_t crc = 0xFFFF;
    while (count--) {
        crc ^= (uint16_t)(*bytes++ << 8);
        for (int bit = 0; bit < 8; bit++) crc = (uint16_t)(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
    }
    return crc;
}

static unsigned char *put(unsigned char *to, int32_t value, int bytes)
{
    while (bytes--) *to++ = (unsigned char)((uint32_t)value >> 8 * bytes);
    return to;
}

static int32_t get(const unsigned char *from, int bytes)
{
    uint32_t value = bytes == 2 && from[0] & 0x80 ? 0xFFFF : 0;
    while (bytes--) value = value << 8 | *from++;
    return (int32_t)value;
}

static double noise_urad;
static const char *fault = "none";
static long fault_tick, tick;

static int has(const char *kind) { return tick >= fault_tick && !strcmp(fault, kind); }

static double normal(void) /* the sum of twelve uniform numbers: mean 0, variance 1 */
{
    static uint32_t state = 12345;
    double sum = -6;
    for (int i = 0; i < 12; i++) sum += (state = state * 1664525u + 1013904223u) / 4294967296.0;
    return sum;
}

static void sense(int32_t urad[3])
{
    static double q[3];
    if (has("frozen")) return;
    if (!has("stuck")) {
        q[0] = atan2(-R[1][2], R[2][2]), q[1] = asin(R[0][2]);
        q[2] = atan2(-R[0][1], R[0][0]) * (has("reversed") ? -1 : 1);
    }
    for (int i = 0; i < 3; i++) urad[i] = (int32_t)lround(1e6 * q[i] + noise_urad * normal());
}

static int measure(unsigned char *frame, uint16_t sequence, uint16_t echo, int flags)
{
    static int32_t urad[3];
    sense(urad);
    unsigned char *end = frame;
    end = put(put(put(put(end, '#', 1), sequence, 2), echo, 2), flags, 1);
    for (int i = 0; i < 3; i++) end = put(end, urad[i], 4);
    for (int j = 0; j < GROUPS; j++) end = put(end, (int32_t)lround(1e3 * current[j]), 2);
    end = put(end, crc16(frame, (int)(end - frame)), 2);
    end = put(put(end, '\r', 1), '\n', 1);
    return (int)(end - frame);
}

int main(int count, char **arguments)
{
    char line[256];
    double deg;
    FILE *file = count >= 2 ? fopen(arguments[1], "r") : NULL;
    if (!file) return 2;
    if (count > 2) noise_urad = atof(arguments[2]);
    if (count > 4) fault = arguments[3], fault_tick = atol(arguments[4]);
    while (samples < 1024 && fgets(line, sizeof line, file))
        if (sscanf(line, "%lf,%lf", &deg, &curve[samples]) == 2) samples++;
    fclose(file);

    int udp = socket(AF_INET, SOCK_DGRAM, 0);
    struct sockaddr_in here = {.sin_family = AF_INET}, peer;
    socklen_t size = sizeof here;
    struct timeval wait = {86400, 0}; /* a day: it ends only what a killed test has left */
    here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (udp < 0 || bind(udp, (struct sockaddr *)&here, size) || getsockname(udp, (struct sockaddr *)&here, &size))
        return 2;
    setsockopt(udp, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
    printf("%d\n", ntohs(here.sin_port));
    fflush(stdout);

    unsigned char in[512], out[512];
    const int command_size = 1 + 2 + 1 + 2 * GROUPS + 2 + 2;
    uint16_t sequence = 0;
    int32_t last = -1;
    for (;;) {
        size = sizeof peer;
        ssize_t received = recvfrom(udp, in, sizeof in, 0, (struct sockaddr *)&peer, &size);
        if (received < 0) return 1;
        if (received != command_size || in[0] != '!') continue;
        if ((get(in + command_size - 4, 2) & 0xFFFF) != crc16(in, command_size - 4)) continue;
        int32_t number = get(in + 1, 2) & 0xFFFF;
        int flags = in[3];
        if (flags & END) return 0;
        if (number != last && !(flags & HELLO)) {
            double command[GROUPS];
            for (int j = 0; j < GROUPS; j++) command[j] = flags & ARMED ? 1e-3 * get(in + 4 + 2 * j, 2) : 0;
            double torque = has("limp") ? 0 : has("strong") ? 1.2 : 1;
            for (int j = 0; j < GROUPS; j++) command[j] *= torque;
            for (int i = 0; i < STEPS; i++) step(command);
            tick++;
        }
        last = number;
        int bytes = measure(out, ++sequence, (uint16_t)number, flags & ARMED);
        sendto(udp, out, (size_t)bytes, 0, (struct sockaddr *)&peer, size);
    }
}
