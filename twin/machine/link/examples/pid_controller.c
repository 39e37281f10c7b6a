/* PID controller of the spherical actuator over UDP: C99 and POSIX sockets, no other dependencies.
 *
 *   cc -std=c99 -O2 -o pid_controller pid_controller.c -lm
 *   spheretwin machine sinusoid --listen udp://127.0.0.1:5005 &
 *   ./pid_controller 127.0.0.1 5005 torque_curve.csv 10
 *
 * torque_curve.csv: the torque of one coil on one pole; `spheretwin.models` has it. The last argument is the
 * duration in s. All three angles follow 0.2 sin(pi t) rad. The program is for little-endian processors.
 *
 * Each cycle: receive a measurement, compute the torque, send the currents. A command is sent again if its
 * answer is lost: the machine applies it once. */

#define _POSIX_C_SOURCE 200809L

#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define GROUPS 18
#define POLES 16
#define ARMED 1
#define HELLO 2
#define END 4

static const double PI = 3.14159265358979323846;
static const double PERIOD_S = 1e-3, LIMIT_A = 8.0, BANDWIDTH = 40.0; /* 1/s: a triple pole of the loop */
static const double INERTIA[3] = {2.22e-3, 2.18e-3, 2.26e-3};         /* kg m^2 */

typedef struct { uint32_t sequence, echo, session; uint16_t flags; double angle[3]; } Measurement;

/* Frames: CRC-16/CCITT-FALSE over all bytes before the checksum. */

static uint16_t crc16(const unsigned char *bytes, size_t count)
{
    uint16_t crc = 0xFFFF;
    for (size_t i = 0; i < count; i++) {
        crc ^= (uint16_t)(bytes[i] << 8);
        for (int bit = 0; bit < 8; bit++) crc = (uint16_t)(crc & 0x8000 ? (crc << 1) ^ 0x1021 : crc << 1);
    }
    return crc;
}

static size_t encode(unsigned char *out, uint32_t sequence, uint32_t session, uint16_t flags, double t,
                     const double *current)
{
    size_t n = 0;
    out[n++] = 0xA5, out[n++] = 0xC3;
    memcpy(out + n, &sequence, 4), n += 4;
    memcpy(out + n, &flags, 2), n += 2;
    memcpy(out + n, &t, 8), n += 8;
    memcpy(out + n, current, 8 * GROUPS), n += 8 * GROUPS;
    memcpy(out + n, &session, 4), n += 4;
    uint16_t crc = crc16(out, n);
    memcpy(out + n, &crc, 2);
    return n + 2;
}

static int decode(const unsigned char *in, size_t count, Measurement *m)
{
    /* start 2, sequence 4, echo 4, flags 2, time 8, angles 24, rates 24, currents, temperature 8, session 4, crc 2 */
    const size_t size = 2 + 4 + 4 + 2 + 8 + 24 + 24 + 8 * GROUPS + 8 + 4 + 2;
    uint16_t crc;
    if (count != size || in[0] != 0xA5 || in[1] != 0x5A) return 0;
    memcpy(&crc, in + size - 2, 2);
    if (crc != crc16(in, size - 2)) return 0;
    memcpy(&m->sequence, in + 2, 4), memcpy(&m->echo, in + 6, 4), memcpy(&m->flags, in + 10, 2);
    memcpy(m->angle, in + 20, 24), memcpy(&m->session, in + size - 6, 4);
    return isfinite(m->angle[0]) && isfinite(m->angle[1]) && isfinite(m->angle[2]);
}

/* Torque matrix: a pole with axis r (stator frame) and a coil with axis s at the angle phi give the torque
 * f(phi) per ampere about r x s. A group is a coil and the opposite one. */

static double curve_deg[1024], curve[1024];
static int samples;

static int read_curve(const char *path)
{
    char line[256];
    FILE *file = fopen(path, "r");
    if (!file) return 0;
    while (samples < 1024 && fgets(line, sizeof line, file))
        if (sscanf(line, "%lf,%lf", &curve_deg[samples], &curve[samples]) == 2) samples++;
    fclose(file);
    return samples > 1;
}

static double torque_per_ampere(double deg)
{
    int low = 0, high = samples - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (curve_deg[middle] <= deg) low = middle; else high = middle;
    }
    double share = (deg - curve_deg[low]) / (curve_deg[high] - curve_deg[low]);
    return curve[low] + share * (curve[high] - curve[low]);
}

static void axis_at(double latitude_deg, double longitude_deg, double axis[3])
{
    double latitude = latitude_deg * PI / 180, longitude = longitude_deg * PI / 180;
    axis[0] = cos(latitude) * cos(longitude);
    axis[1] = cos(latitude) * sin(longitude);
    axis[2] = sin(latitude);
}

static void add_torque(const double r[3], const double s[3], double side, double polarity, double column[3])
{
    double cross[3] = {r[1] * s[2] - r[2] * s[1], r[2] * s[0] - r[0] * s[2], r[0] * s[1] - r[1] * s[0]};
    double sine = sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
    double cosine = side * (r[0] * s[0] + r[1] * s[1] + r[2] * s[2]);
    if (sine < 1e-9) return; /* no torque on a pole in front of the coil */
    double f = polarity * side * torque_per_ampere(atan2(sine, cosine) * 180 / PI) / sine;
    for (int i = 0; i < 3; i++) column[i] += f * cross[i];
}

static void torque_matrix(const double q[3], double G[GROUPS][3])
{
    double ca = cos(q[0]), sa = sin(q[0]), cb = cos(q[1]), sb = sin(q[1]), cg = cos(q[2]), sg = sin(q[2]);
    double R[3][3] = {{cb * cg, -cb * sg, sb},
                      {ca * sg + sa * sb * cg, ca * cg - sa * sb * sg, -sa * cb},
                      {sa * sg - ca * sb * cg, sa * cg + ca * sb * sg, ca * cb}};
    for (int j = 0; j < GROUPS; j++) {
        double s[3];
        axis_at(j < 12 ? 28 : 0, 30 * (j % 12), s);
        G[j][0] = G[j][1] = G[j][2] = 0;
        for (int pole = 0; pole < POLES; pole++) {
            double own[3], r[3], polarity = pole % 2 ? -1 : 1;
            axis_at(pole < 8 ? 18 : -18, 45 * (pole % 8), own);
            for (int i = 0; i < 3; i++) r[i] = R[i][0] * own[0] + R[i][1] * own[1] + R[i][2] * own[2];
            add_torque(r, s, 1, polarity, G[j]);
            add_torque(r, s, -1, polarity, G[j]);
        }
    }
}

/* Least-norm currents for a torque in the stator frame: G^T (G G^T)^-1 torque, scaled at the limit. */

static void allocate(double G[GROUPS][3], const double torque[3], double current[GROUPS])
{
    double A[3][3] = {{0}}, w[3], largest = 0;
    for (int j = 0; j < GROUPS; j++)
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) A[a][b] += G[j][a] * G[j][b];
    double det = A[0][0] * (A[1][1] * A[2][2] - A[1][2] * A[2][1])
               - A[0][1] * (A[1][0] * A[2][2] - A[1][2] * A[2][0])
               + A[0][2] * (A[1][0] * A[2][1] - A[1][1] * A[2][0]);
    for (int a = 0; a < 3; a++) { /* Cramer's rule */
        double B[3][3];
        memcpy(B, A, sizeof B);
        for (int b = 0; b < 3; b++) B[b][a] = torque[b];
        w[a] = (B[0][0] * (B[1][1] * B[2][2] - B[1][2] * B[2][1])
              - B[0][1] * (B[1][0] * B[2][2] - B[1][2] * B[2][0])
              + B[0][2] * (B[1][0] * B[2][1] - B[1][1] * B[2][0])) / det;
    }
    for (int j = 0; j < GROUPS; j++) {
        current[j] = G[j][0] * w[0] + G[j][1] * w[1] + G[j][2] * w[2];
        largest = fmax(largest, fabs(current[j]));
    }
    for (int j = 0; j < GROUPS; j++) current[j] *= !(largest > LIMIT_A) ? 1 : LIMIT_A / largest;
}

/* PID on each axis; the rate is a difference, filtered with 2 ms. */

static void control(double t, const double q[3], double current[GROUPS])
{
    static double last[3], rate[3], integral[3];
    static int is_started;
    double G[GROUPS][3], torque_q[3], torque[3];
    for (int i = 0; i < 3; i++) {
        double difference = is_started ? (q[i] - last[i]) / PERIOD_S : 0;
        rate[i] += PERIOD_S / (PERIOD_S + 2e-3) * (difference - rate[i]);
        double error = 0.2 * sin(PI * t) - q[i], error_rate = 0.2 * PI * cos(PI * t) - rate[i];
        integral[i] += PERIOD_S * error;
        torque_q[i] = INERTIA[i] * (3 * pow(BANDWIDTH, 2) * error + 3 * BANDWIDTH * error_rate
                                    + pow(BANDWIDTH, 3) * integral[i] - 0.2 * PI * PI * sin(PI * t));
        last[i] = q[i];
    }
    is_started = 1;
    /* From the torque on the hinges to the torque in the stator frame: E^-T. */
    double in_plane = (torque_q[2] - sin(q[1]) * torque_q[0]) / cos(q[1]);
    torque[0] = torque_q[0];
    torque[1] = cos(q[0]) * torque_q[1] - sin(q[0]) * in_plane;
    torque[2] = sin(q[0]) * torque_q[1] + cos(q[0]) * in_plane;
    torque_matrix(q, G);
    allocate(G, torque, current);
}

int main(int count, char **arguments)
{
    if (count != 5 || !read_curve(arguments[3])) {
        fprintf(stderr, "usage: pid_controller HOST PORT torque_curve.csv DURATION_S\n");
        return 2;
    }
    struct sockaddr_in machine = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(arguments[2]))};
    int udp = socket(AF_INET, SOCK_DGRAM, 0);
    struct timeval wait = {0, 100000};
    struct timespec pause = {0, 100000000};
    if (inet_pton(AF_INET, arguments[1], &machine.sin_addr) != 1 || udp < 0
        || connect(udp, (struct sockaddr *)&machine, sizeof machine) != 0) return 2;
    setsockopt(udp, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);

    unsigned char command[512], answer[2048];
    double current[GROUPS] = {0}, largest = 0;
    long ticks = lround(atof(arguments[4]) / PERIOD_S);
    uint32_t sequence = 0;
    uint16_t flags = HELLO; /* the first command requests a measurement */
    Measurement m = {0};
    for (long tick = 0; tick <= ticks; tick++) {
        double t = PERIOD_S * (double)tick;
        /* A request has a number of ours; the answer has that of the session. */
        uint32_t session = flags == HELLO ? (uint32_t)time(NULL) | 1 : m.session;
        size_t size = encode(command, ++sequence, session, flags, t, current);
        int attempts = 0;
        do {
            send(udp, command, size, 0);
            ssize_t received;
            do { /* older answers may still arrive: only silence is a reason to send again */
                received = recv(udp, answer, sizeof answer, 0);
                if (received <= 0 || !decode(answer, (size_t)received, &m)) m.echo = 0;
            } while (received > 0 && m.echo != sequence);
            if (received < 0 && errno == ECONNREFUSED) nanosleep(&pause, NULL); /* nobody listens yet */
        } while (m.echo != sequence && ++attempts < 600);
        if (m.echo != sequence) {
            fprintf(stderr, "pid_controller: no answer from the machine\n");
            return 1;
        }
        if (tick > ticks / 2) /* after the transient */
            for (int i = 0; i < 3; i++) largest = fmax(largest, fabs(m.angle[i] - 0.2 * sin(PI * t)));
        if (m.flags & END) break;
        flags = ARMED;
        control(t, m.angle, current);
    }
    memset(current, 0, sizeof current);
    size_t size = encode(command, ++sequence, m.session, END, 0, current);
    for (int i = 0; i < 3; i++) send(udp, command, size, 0);
    printf("largest error in the second half: %.3f mrad\n", 1e3 * largest);
    close(udp);
    return 0;
}
