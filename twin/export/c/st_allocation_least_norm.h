/* SPDX-License-Identifier: MIT */
/* Allocation: least-norm currents, scaled as a whole to respect the limit. */
#include "st_least_norm.h"

static st_real st_allocate(
    st_real G[3][ST_GROUPS], const st_real torque[3], st_real limit, st_real current[ST_GROUPS])
{
    return st_least_norm(G, torque, limit, current);
}
