"""The yardstick: the same closed loop the plain way, a Python loop with NumPy and one `mj_step` a step.

Written as a careful engineer would write it first: arrays instead of loops over poles and coils, the
same physics, laws and rates as the product, none of its code in the loop.
"""

import mujoco
import numpy as np

CENTRES = np.array([-3.0, -1.5, 0.0, 1.5, 3.0])


class PlainPd:
    """``-stiffness e - damping edot``, as an acceleration."""

    def __init__(self, stiffness, damping, inertia):
        self.stiffness, self.damping, self.inertia = np.array(stiffness), np.array(damping), inertia

    def __call__(self, reference, q, qdot):
        error, error_rate = q - reference[0], qdot - reference[1]
        return -self.inertia * (self.stiffness * error + self.damping * error_rate)


class PlainAfsm:
    """Equations (40)-(43) on all three axes at once, 75 consequents each."""

    def __init__(self, inertia, period):
        self.inertia, self.period = inertia, period
        self.theta, self.xi, self.zeta = np.zeros((3, 75)), np.zeros(3), np.zeros(3)

    def __call__(self, reference, q, qdot):
        s = 50 * (q - reference[0]) + qdot - reference[1]
        bound = 1 + np.abs(s) + s**2
        exponent = -0.125 * (np.stack([qdot, q])[:, :, None] - CENTRES) ** 2  # (2, 3, 5)
        sets = np.exp(exponent - exponent.max(axis=2, keepdims=True))
        sets /= sets.sum(axis=2, keepdims=True)
        psi = (sets[0][:, :, None] * sets[1][:, None, :]).reshape(3, 25)
        regressor = np.concatenate([psi, psi * qdot[:, None], psi * q[:, None]], axis=1)  # (3, 75)
        fuzzy = np.sum(self.theta * regressor, axis=1)
        v = fuzzy - np.sign(s) * (self.xi + self.zeta * bound) - 20 * s
        self.theta -= 10 * self.period * s[:, None] * regressor
        self.xi += 10 * self.period * np.abs(s)
        self.zeta += 10 * self.period * np.abs(s) * bound
        return self.inertia * v


def rotation(q):
    (ca, cb, cg), (sa, sb, sg) = np.cos(q), np.sin(q)
    about_x = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    about_y = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    about_z = np.array([[cg, -sg, 0], [sg, cg, 0], [0, 0, 1]])
    return about_x @ about_y @ about_z, np.stack([[1, 0, 0], about_x[:, 1], about_x @ about_y[:, 2]], axis=1)


def torque_matrix(R_SR, actuator):
    """(3, 18) by the paper's sum over 16 poles and 36 coils, f_t interpolated linearly."""
    r = actuator.pole_axes @ R_SR.T  # (16, 3)
    phi = np.arccos(np.clip(r @ actuator.coil_axes.T, -1, 1))  # (16, 36)
    curve = actuator.torque_curve
    force = np.interp(phi, curve.phi_rad, curve.torque_Nm_per_A) / np.maximum(np.sin(phi), 1e-9)
    weighted = (actuator.pole_polarity[:, None] * force).T @ r  # (36, 3)
    columns = np.cross(weighted, actuator.coil_axes)  # (36, 3)
    return columns[actuator.groups].sum(axis=1).T


def allocated(G, E, torque_q, limit):
    """Least-norm currents for a generalised torque, scaled as a whole to respect the limit."""
    command = G.T @ np.linalg.solve(G @ G.T, np.linalg.solve(E.T, torque_q))
    return command * min(1.0, limit / max(np.abs(command).max(), 1e-300))


def run(model, data, actuator, scenario, law, reference, disturbance, ticks):
    """Run the first control ticks; returns the telemetry rows as a list."""
    steps = scenario.plant.step_s * actuator.group.resistance_ohm / actuator.group.inductance_H
    decay, mean_share = np.exp(-steps), (1 - np.exp(-steps)) / steps
    current, limit = np.zeros(18), actuator.group.current_limit_A
    unknown = np.array(scenario.plant.modelling_torque_Nm)
    rows = []
    for tick in range(ticks):
        q, qdot = data.qpos.copy(), data.qvel.copy()
        torque_q = law(reference[tick], q, qdot)
        R_SR, E = rotation(q)
        G = torque_matrix(R_SR, actuator)
        command = allocated(G, E, torque_q, limit)
        for substep in range(scenario.substeps):
            middle_R, middle_E = rotation(data.qpos + 0.5 * model.opt.timestep * data.qvel)
            G = torque_matrix(middle_R, actuator)
            mean = command + mean_share * (current - command)
            current = command + decay * (current - command)
            torque = G @ mean
            data.qfrc_applied[:] = middle_E.T @ torque - disturbance[tick] - unknown
            if substep == 0:
                rows.append((q, qdot, q - reference[tick][0], torque_q, torque, command, mean))
            mujoco.mj_step(model, data)
    return rows
