/* SPDX-License-Identifier: MIT */
/* Rates of the states of the plant, for one type of numbers T; included after st_equations.h. */

/* Torque of a group over that of the torque matrix, at the temperature of the rotor. */
static inline T NAME(gain)(const st_parameters *p, int group, T rotor_degC)
{
#if ST_THERMAL
    return (1 + p->remanence_per_K * (rotor_degC - 20)) * p->torque_gain[group];
#else
    (void)rotor_degC;
    return p->torque_gain[group];
#endif
}

/* Back-EMF of each group at the given motion, V. */
static inline void NAME(back_emf)(const st_parameters *p, T rotor_degC, const T q[3], const T v[3], T G[3][ST_GROUPS],
    T e[ST_GROUPS])
{
    T w[3];
    int j;
    NAME(angular_velocity)(q, v, w);
    for (j = 0; j < ST_GROUPS; j++) {
        e[j] = NAME(gain)(p, j, rotor_degC) * (G[0][j] * w[0] + G[1][j] * w[1] + G[2][j] * w[2]);
    }
}

/* Torque of the coils on the rotor in frame S, N m. */
static inline void NAME(coil_torque)(
    const st_parameters *p, T rotor_degC, T G[3][ST_GROUPS], const T current[ST_GROUPS], T torque_S[3])
{
    int i, j;
    for (i = 0; i < 3; i++) {
        torque_S[i] = 0;
        for (j = 0; j < ST_GROUPS; j++) {
            torque_S[i] += G[i][j] * (NAME(gain)(p, j, rotor_degC) * current[j]);
        }
    }
}

/* Friction of a hinge divided by its rate, N m s: viscous, and Coulomb's, smoothed over a rate. */
static inline T NAME(friction_factor)(const st_parameters *p, int hinge, T rate)
{
    const double smoothing = p->friction_smoothing_rad_s;
    const double excess = RE(rate) > 0 ? p->coulomb_asymmetry[hinge] : -p->coulomb_asymmetry[hinge];
    return p->viscous_Nm_s[hinge] + p->coulomb_Nm[hinge] * (1 + excess) / ROOT(rate * rate + smoothing * smoothing);
}

/* Resistance of a group at a temperature of its winding, ohm. */
static inline T NAME(resistance)(const st_parameters *p, int group, T winding_degC)
{
    return p->resistance_ohm[group] * (1 + p->resistance_per_K[group] * (winding_degC - 20));
}

#if !ST_VOLTAGES
static inline T NAME(clipped)(T command, double limit)
{
    return RE(command) > limit ? limit : RE(command) < -limit ? -limit : command;
}
#endif

static inline void NAME(rates)(const st_parameters *p, const T *input, const T *x, T *rate)
{
    T coil_q[3], coil_v[3], torque_S[3], torque[3], G[3][ST_GROUPS];
    const T *q = x + ST_Q, *v = x + ST_QDOT, *current = x + ST_CURRENT, *winding = x + ST_WINDING;
    T released_W = 0;
    int i, j;
    NAME(coil_motion)(q, v, coil_q, coil_v);
    NAME(torque_matrix)(coil_q, G);
    NAME(coil_torque)(p, x[ST_ROTOR], G, current, torque_S);
    NAME(hinge_torque_of)(q, torque_S, torque);
    for (i = 0; i < 3; i++) {
        torque[i] -= input[ST_DISTURBANCE + i] + p->constant_torque_Nm[i] + p->spring_Nm_rad[i] * q[i];
        torque[i] -= NAME(friction_factor)(p, i, v[i]) * v[i];
        rate[ST_Q + i] = v[i];
    }
    NAME(hinge_acceleration)(p, q, v, torque, rate + ST_QDOT);
#if ST_VOLTAGES
    NAME(back_emf)(p, x[ST_ROTOR], coil_q, coil_v, G, rate + ST_CURRENT);
#endif
    for (j = 0; j < ST_GROUPS; j++) {
        const T R = NAME(resistance)(p, j, winding[j]);
        const T released = (winding[j] - x[ST_STATOR]) / p->thermal_resistance_K_W[j];
#if ST_VOLTAGES
        const T e = rate[ST_CURRENT + j];
        rate[ST_CURRENT + j] = (input[ST_COMMAND + j] - R * current[j] - e) / p->inductance_H[j];
#else
        rate[ST_CURRENT + j]
            = (NAME(clipped)(input[ST_COMMAND + j], p->current_limit_A) - current[j]) / p->lag_s[j];
#endif
        rate[ST_WINDING + j] = (R * (current[j] * current[j]) - released) / p->heat_capacity_J_K[j];
        released_W += released;
    }
#if ST_THERMAL
    {
        const T across = (x[ST_STATOR] - x[ST_ROTOR]) / p->air_gap_K_W;
        const T outside = (x[ST_STATOR] - p->ambient_degC) / p->stator_to_ambient_K_W;
        const T shaft = (x[ST_ROTOR] - p->ambient_degC) / p->rotor_to_ambient_K_W;
        rate[ST_STATOR] = (released_W - across - outside) / p->stator_heat_capacity_J_K;
        rate[ST_ROTOR] = (across - shaft) / p->rotor_heat_capacity_J_K;
    }
#else
    (void)released_W;
    rate[ST_STATOR] = rate[ST_ROTOR] = 0;
#endif
}
