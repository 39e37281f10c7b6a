/* SPDX-License-Identifier: MIT */
/* Least-norm currents for a torque, scaled as a whole to respect the limit. Returns the share of the torque that
 * they give: 0 if the torque matrix has lost rank. */
static st_real st_least_norm(
    st_real G[3][ST_GROUPS], const st_real torque[3], st_real limit, st_real current[ST_GROUPS])
{
    st_real a = 0, b = 0, c = 0, d = 0, e = 0, f = 0; /* G G^T = [[a, b, c], [b, d, e], [c, e, f]] */
    st_real cofactor[3], weight[3], determinant, trace, x, y, z, largest = 0, scale;
    int j;
    for (j = 0; j < ST_GROUPS; j++) {
        a += G[0][j] * G[0][j];
        b += G[0][j] * G[1][j];
        c += G[0][j] * G[2][j];
        d += G[1][j] * G[1][j];
        e += G[1][j] * G[2][j];
        f += G[2][j] * G[2][j];
    }
    cofactor[0] = d * f - e * e;
    cofactor[1] = c * e - b * f;
    cofactor[2] = b * e - c * d;
    determinant = a * cofactor[0] + b * cofactor[1] + c * cofactor[2];
    trace = a + d + f;
    if (!(determinant > ST_SINGULAR * (trace * trace * trace))) {
        for (j = 0; j < ST_GROUPS; j++) {
            current[j] = 0;
        }
        return 0;
    }
    x = torque[0] / determinant;
    y = torque[1] / determinant;
    z = torque[2] / determinant;
    weight[0] = cofactor[0] * x + cofactor[1] * y + cofactor[2] * z;
    weight[1] = cofactor[1] * x + (a * f - c * c) * y + (b * c - a * e) * z;
    weight[2] = cofactor[2] * x + (b * c - a * e) * y + (a * d - b * b) * z;
    for (j = 0; j < ST_GROUPS; j++) {
        current[j] = G[0][j] * weight[0] + G[1][j] * weight[1] + G[2][j] * weight[2];
        largest = st_greatest(largest, st_fabs(current[j]));
    }
    if (largest <= limit) {
        return 1;
    }
    scale = limit / largest;
    for (j = 0; j < ST_GROUPS; j++) {
        current[j] = st_within(current[j] * scale, limit);
    }
    return scale;
}
