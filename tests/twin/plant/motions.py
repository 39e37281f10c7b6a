"""Motions of a rotor with friction and without, step by step as in the plant, and orders of convergence."""

import numpy as np

from spheretwin.models.base.compiled import compiled
from spheretwin.models.joint_chain import JointChain, fill_ideal
from spheretwin.models.kinematics import rate_jacobian, rotation, rotor_rate_jacobian
from spheretwin.models.lagrangian import GRAVITY_m_s2, loaded_inertia
from spheretwin.plant.bristle_friction import BristleFriction, apply_bristles, begin_bristles
from spheretwin.plant.friction import Friction, fill_friction, slow_down
from spheretwin.plant.lagrangian_rotor import LagrangianRotor
from spheretwin.plant.lagrangian_rotor import step as step_rotor

STEP_s = 5e-4
UPRIGHT, STILL, NONE = np.zeros((3, 3))


def on_gamma(values):
    """Values on the third hinge alone, which upright has the inertia J3."""
    return np.multiply.outer(np.asarray(values, float), [0.0, 0.0, 1.0])


@compiled
def moving(plant, bristles, viscous, torque, q, qdot, bearing, every):
    """Steps of the plant as `plant_tick` takes them; states before each step, torque of the bearing in it."""
    middle_q, middle_qdot, last_qdot, unused = np.zeros(3), np.zeros(3), plant.qdot.copy(), np.zeros(3)
    for row in range(torque.shape[0]):
        for i in range(3):
            if row % every == 0:
                q[row // every, i], qdot[row // every, i] = plant.q[i], plant.qdot[i]
            middle_q[i] = plant.q[i] + 0.5 * viscous.step_s * plant.qdot[i]
            middle_qdot[i] = plant.qdot[i] + 0.5 * (plant.qdot[i] - last_qdot[i])
            last_qdot[i] = plant.qdot[i]
            plant.torque_q[i] = torque[row, i]
        slow_down(viscous, plant.joint, plant.q, plant.qdot, unused)
        begin_bristles(bristles, middle_q, plant.q, plant.qdot, plant.torque_q)
        step_rotor(plant)
        apply_bristles(bristles, plant.joint, middle_q, middle_qdot, last_qdot, plant.q, plant.qdot)
        slow_down(viscous, plant.joint, plant.q, plant.qdot, unused)
        for i in range(3):
            bearing[row // every, i] = bristles.torque_q[0, i]


def motion(rotor, bristles, torque, start=UPRIGHT, rates=STILL, viscous_Nm_s=0.0, every=1):
    """Pose, rates and torque of the bearing (n, 3) of a rotor under torques (n, 3)."""
    resistance = friction(NONE, np.full(3, viscous_Nm_s), 0.01, bristles.step_s)
    return steps(rotor, bristles, resistance, torque, start, rates, every)


def friction(*arguments):
    return Friction.filled(fill_friction, *arguments)[0]


def steps(rotor, bristles, resistance, torque, start, rates, every=1):
    q, qdot, bearing = np.zeros((3, -(-len(torque) // every), 3))
    elements = BristleFriction.zeros()[0] if bristles is None else bristles
    moving(rotor.start(start, rates), elements, resistance, torque, q, qdot, bearing, every)
    return q, qdot, bearing


def ideal_rotor(actuator, step_s, modelling_error=0.0, payload_kg=0.0, gravity_m_s2=GRAVITY_m_s2):
    height_m = actuator.payload_mount_m[2]
    inertia = loaded_inertia((1 + modelling_error) * actuator.inertia, payload_kg, height_m)
    joints = JointChain.filled(fill_ideal, inertia, payload_kg * gravity_m_s2 * height_m)
    return LagrangianRotor(joints, step_s)


def kinetic_J(q, qdot, actuator, payload_kg, modelling_error=0.0):
    """Rotor by its body rates and point mass by its velocity, not by any matrix of the Lagrangian."""
    w_SR_R, w_SR_S = rotor_rate_jacobian(q) @ qdot, rate_jacobian(q) @ qdot
    velocity = np.cross(w_SR_S, rotation(q) @ actuator.payload_mount_m)
    rotor = (1 + modelling_error) * w_SR_R @ (actuator.inertia * w_SR_R)
    return 0.5 * (rotor + payload_kg * velocity @ velocity)


def potential_J(q, actuator, payload_kg, gravity_m_s2=9.81):
    return payload_kg * gravity_m_s2 * (rotation(q) @ actuator.payload_mount_m)[2]


def gradient(function, at, h=1e-3):
    """Central differences of fourth order; the last index is that of the argument."""
    steps = h * np.eye(len(at))
    near = np.array([function(at + d) - function(at - d) for d in steps])
    far = np.array([function(at + 2 * d) - function(at - 2 * d) for d in steps])
    return np.moveaxis((8 * near - far) / (12 * h), 0, -1)


def order(steps, errors):
    """Order of convergence of errors with the step."""
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]
