/* Firmware of the independent machine in `../../../independent/rotor.h`.
 *
 *   firmware torque_curve.csv [fault=KIND@TICK] [NAME=VALUE...]
 *
 * It prints the port, then answers each command over UDP until END. The settings are those of `rotor.h`; the time
 * of `at=` is that of the commands. From a tick on it has a fault: `frozen` angles, bit for bit; a `stuck`
 * sensor, with its noise; a `reversed` third angle.
 *
 * Frames as in firmware.toml: big-endian, angles in microradians, currents in milliamperes, CRC-16, CR LF. */

#define _POSIX_C_SOURCE 200809L

#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/time.h>

#include "../../../independent/rotor.h"

enum { ARMED = 1, HELLO = 2, END = 4 };

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

static char fault[16] = "none";
static long fault_tick, tick;

static int has(const char *kind) { return tick >= fault_tick && !strcmp(fault, kind); }

static void report(int32_t urad[3])
{
    static double last[3];
    double q[3], still[3];
    if (has("frozen")) return;
    sense(q), angles(still);
    if (has("stuck"))
        for (int i = 0; i < 3; i++) q[i] += last[i] - still[i];
    else
        memcpy(last, still, sizeof last);
    if (has("reversed")) q[2] *= -1;
    for (int i = 0; i < 3; i++) urad[i] = (int32_t)lround(1e6 * q[i]);
}

static int measure(unsigned char *frame, uint16_t sequence, uint16_t echo, int flags)
{
    static int32_t urad[3];
    report(urad);
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
    int first = 2;
    if (count > 2 && sscanf(arguments[2], "fault=%15[a-z]@%ld", fault, &fault_tick) == 2) first = 3;
    if (count < 2 || !read_curve(arguments[1]) || !settings(count - first, arguments + first)) return 2;
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
            take_effect(PERIOD_S * (double)tick);
            for (int i = 0; i < STEPS; i++) step(command);
            tick++;
        }
        last = number;
        int bytes = measure(out, ++sequence, (uint16_t)number, flags & ARMED);
        sendto(udp, out, (size_t)bytes, 0, (struct sockaddr *)&peer, size);
    }
}
