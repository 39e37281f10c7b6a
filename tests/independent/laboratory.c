/* Log of a machine of `rotor.h` under a controller of its own, as CSV on standard output:
 *
 *   laboratory torque_curve.csv SECONDS [NAME=VALUE...]
 *
 * Time in microseconds of a counter of 32 bits that started long ago, angles in degrees, the third in counts,
 * commanded currents in milliamperes. The commands act one period later. All hinges follow a sine plus a fifth
 * of another one with 2.7 times its frequency; PID on each hinge, and the least currents for its torque. */

#define _POSIX_C_SOURCE 200809L

#include "rotor.h"

static const double BANDWIDTH = 40.0; /* 1/s: triple pole of the loop */

/* Least currents for torques on the hinges: columns of the groups on the hinges, and the solution of three
 * equations by elimination; the matrix is symmetric and positive. */
static void allocate(const double wanted[3], double command[GROUPS])
{
    double axes[3][3], dual[3][3], column[3], G[GROUPS][3], A[3][4] = {{0}};
    hinges(axes, dual);
    for (int j = 0; j < GROUPS; j++) {
        group_torque(j, column);
        for (int i = 0; i < 3; i++) G[j][i] = dot(axes[i], column);
    }
    for (int a = 0; a < 3; a++) {
        A[a][3] = wanted[a];
        for (int b = 0; b < 3; b++)
            for (int j = 0; j < GROUPS; j++) A[a][b] += G[j][a] * G[j][b];
    }
    for (int p = 0; p < 3; p++)
        for (int a = 0; a < 3; a++)
            if (a != p)
                for (int b = 3; b >= p; b--) A[a][b] -= A[a][p] / A[p][p] * A[p][b];
    for (int j = 0; j < GROUPS; j++) {
        command[j] = 0;
        for (int i = 0; i < 3; i++) command[j] += G[j][i] * A[i][3] / A[i][i];
        command[j] = fmax(-8, fmin(8, 1e-3 * round(1e3 * command[j])));
    }
}

static void control(double t_s, const double q[3], double command[GROUPS])
{
    static double last[3], rate[3], integral[3];
    static int is_started;
    double wanted[3];
    for (int i = 0; i < 3; i++) {
        double turn_s = 2 * acos(-1) * frequency[i], other_s = 2.7 * turn_s, a = amplitude[i];
        double place = a * sin(turn_s * t_s) + 0.2 * a * sin(other_s * t_s);
        double speed = a * turn_s * cos(turn_s * t_s) + 0.2 * a * other_s * cos(other_s * t_s);
        double push = -a * turn_s * turn_s * sin(turn_s * t_s) - 0.2 * a * other_s * other_s * sin(other_s * t_s);
        if (is_started) rate[i] += 0.1 * ((q[i] - last[i]) / PERIOD_S - rate[i]);
        last[i] = q[i];
        double error = place - q[i], b = BANDWIDTH;
        integral[i] += PERIOD_S * error;
        wanted[i] = BARE_J[i] * (3 * b * b * error + 3 * b * (speed - rate[i]) + b * b * b * integral[i] + push);
    }
    is_started = 1;
    allocate(wanted, command);
}

int main(int number, char **texts)
{
    if (number < 3 || !read_curve(texts[1]) || !settings(number - 3, texts + 3)) return 2;
    long ticks = lround(atof(texts[2]) / PERIOD_S);
    double command[GROUPS] = {0}, before[GROUPS], q[3];
    printf("micros,pot_a,pot_b,count");
    for (int j = 0; j < GROUPS; j++) printf(",i%d", j);
    printf("\n");
    for (long tick = 0; tick < ticks; tick++) {
        take_effect(PERIOD_S * (double)tick);
        sense(q);
        memcpy(before, command, sizeof before);
        control(PERIOD_S * (double)tick, q, command);
        printf("%lu", (4293000000ul + 1000ul * (unsigned long)tick) & 0xFFFFFFFFul);
        printf(",%.4f,%.4f,%.0f", RADIAN * q[0], RADIAN * q[1], count[2] > 0 ? q[2] / count[2] : RADIAN * q[2]);
        for (int j = 0; j < GROUPS; j++) printf(",%.0f", 1e3 * command[j]);
        printf("\n");
        for (int i = 0; i < STEPS; i++) step(before);
    }
    return 0;
}
