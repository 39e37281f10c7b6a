/* SPDX-License-Identifier: MIT */
/* First-order Takagi-Sugeno approximator of one axis: 25 rules, 75 adapted consequents. */
enum { ST_SETS = 5, ST_RULES = 25, ST_CONSEQUENTS = 75 };

/* Degrees of membership in the five sets, normalised to the sum 1. */
static void st_memberships(st_real x, st_real degrees[ST_SETS])
{
    st_real nearest, sum = 0;
    int k;
    for (k = 0; k < ST_SETS; k++) {
        const st_real distance = (x - (st_real)(k - 2) * (st_real)1.5) / 2;
        degrees[k] = -(distance * distance) / 2;
    }
    nearest = degrees[0];
    for (k = 1; k < ST_SETS; k++) {
        nearest = st_greatest(nearest, degrees[k]);
    }
    for (k = 0; k < ST_SETS; k++) {
        degrees[k] = st_exp(degrees[k] - nearest);
        sum += degrees[k];
    }
    sum = 1 / sum;
    for (k = 0; k < ST_SETS; k++) {
        degrees[k] *= sum;
    }
}

/* Output of the approximator, then one step of its adaptation. */
static st_real st_approximate(st_real rate, st_real angle, st_real drive, st_real *consequents)
{
    st_real of_rate[ST_SETS], of_angle[ST_SETS], output = 0;
    int i, j;
    st_memberships(rate, of_rate);
    st_memberships(angle, of_angle);
    for (i = 0; i < ST_SETS; i++) {
        for (j = 0; j < ST_SETS; j++) {
            const int k = ST_SETS * i + j;
            const st_real psi = of_rate[i] * of_angle[j], step = drive * psi;
            output += psi
                * (consequents[k] + consequents[ST_RULES + k] * rate + consequents[2 * ST_RULES + k] * angle);
            consequents[k] += step;
            consequents[ST_RULES + k] += step * rate;
            consequents[2 * ST_RULES + k] += step * angle;
        }
    }
    return output;
}
