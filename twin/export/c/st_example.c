/* SPDX-License-Identifier: MIT */
/* Closed loop of the generated controller and the generated plant: the rotor holds the pose 0 under a load.
 *
 * cc -std=c99 -O2 *.c -lm -o example
 */
#include <stdio.h>

#include "st_controller.h"
#include "st_plant.h"

int main(void)
{
    static const st_real reference[3][3] = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    st_parameters parameters;
    st_controller controller;
    st_plant plant;
    double x[ST_STATES], input[ST_INPUTS] = {0}, reached_s;
    int tick, i;
    st_plant_defaults(&parameters, x);
    st_plant_start(&plant, x);
    st_controller_start(&controller);
    input[ST_DISTURBANCE] = 0.02; /* N m on the hinge alpha */
    puts("t_s,alpha_rad,beta_rad,gamma_rad");
    for (tick = 0; tick <= 1000; tick++) {
        st_real angle[3], rate[3], command[ST_GROUPS];
        for (i = 0; i < 3; i++) {
            angle[i] = (st_real)plant.x[ST_Q + i];
            rate[i] = (st_real)plant.x[ST_QDOT + i];
        }
        if (tick % 50 == 0) {
            printf("%.3f,%.17g,%.17g,%.17g\n", tick * (double)ST_PERIOD_S, plant.x[ST_Q], plant.x[ST_Q + 1],
                plant.x[ST_Q + 2]);
        }
        if (st_controller_tick(&controller, reference, angle, rate, command) < 0) {
            return 1;
        }
        for (i = 0; i < ST_GROUPS; i++) {
            input[ST_COMMAND + i] = (double)command[i];
        }
        if (st_plant_advance(&parameters, input, &plant, (double)ST_PERIOD_S, &reached_s) != ST_OK) {
            return 1;
        }
    }
    return 0;
}
