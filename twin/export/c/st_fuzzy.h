/* SPDX-License-Identifier: MIT */
/* First-order Takagi-Sugeno approximator of one axis: 25 rules, 75 adapted consequents. */
enum { ST_SETS = 5, ST_RULES = 25, ST_CONSEQUENTS = 75 };

/* Degrees of membership of a centre in the next set and in the one behind it. */
#define ST_NEXT_DEGREE (st_real)0.7548396019890073 /* exp(-0.28125) */
#define ST_FAR_DEGREE (st_real)0.32465246735834974 /* exp(-1.125) */

/* Degrees of membership in the five sets, normalised to the sum 1: relative to the degree in the middle set,
 * those of the others are powers of one exponential. Beyond 100 an outer set has all of the degree. */
static void st_memberships(st_real x, st_real degrees[ST_SETS])
{
    const st_real rise = st_exp((st_real)0.375 * (x > 100 ? 100 : x < -100 ? -100 : x)), fall = 1 / rise;
    st_real share;
    int k;
    degrees[0] = ST_FAR_DEGREE * fall * fall;
    degrees[1] = ST_NEXT_DEGREE * fall;
    degrees[2] = 1;
    degrees[3] = ST_NEXT_DEGREE * rise;
    degrees[4] = ST_FAR_DEGREE * rise * rise;
    share = 1 / (degrees[0] + degrees[1] + degrees[2] + degrees[3] + degrees[4]);
    for (k = 0; k < ST_SETS; k++) {
        degrees[k] *= share;
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
