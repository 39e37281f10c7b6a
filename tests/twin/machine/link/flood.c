/* Sends frames of a file in turn, 100,000 a second, to a port of this computer until SIGTERM:
 *
 *   flood PORT frames.bin BYTES
 *
 * BYTES is the length of a frame. At the end it prints the datagrams and the seconds. */

#define _POSIX_C_SOURCE 200809L

#include <arpa/inet.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <time.h>

enum { RATE = 100000, BATCH = 100, MOST = 65536 };

static volatile sig_atomic_t is_over;

static void end(int number) { (void)number, is_over = 1; }

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int main(int count, char **arguments)
{
    static unsigned char frames[MOST];
    FILE *file = count == 4 ? fopen(arguments[2], "rb") : NULL;
    if (!file) return 2;
    size_t bytes = (size_t)atol(arguments[3]), number = fread(frames, 1, MOST, file) / (bytes ? bytes : MOST);
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(arguments[1]))};
    int udp = socket(AF_INET, SOCK_DGRAM, 0);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    fclose(file);
    if (!number || udp < 0) return 2;
    signal(SIGTERM, end);
    printf("begins\n"), fflush(stdout);
    double start_s = now_s();
    long sent = 0;
    while (!is_over) {
        for (int i = 0; i < BATCH; i++, sent++)
            sendto(udp, frames + bytes * ((size_t)sent % number), bytes, 0, (struct sockaddr *)&to, sizeof to);
        double ahead_s = start_s + (double)sent / RATE - now_s();
        struct timespec pause = {0, (long)(1e9 * ahead_s)};
        if (ahead_s > 0) nanosleep(&pause, NULL);
    }
    printf("%ld %.3f\n", sent, now_s() - start_s);
    return 0;
}
