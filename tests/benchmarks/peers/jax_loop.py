"""The closed loop in JAX, one row of it: law, allocation, drive and torque matrix, with any rotor.

Its callers jit and vmap it. It is written for the speed of XLA on a CPU, each choice by measurement: poses
and torques are tuples of scalars, which XLA fuses; the sum over the pole lines is a matrix product, as XLA
fuses a plain sum with the look-up and then repeats the look-up for each of the three rows; of a run only the
figures are returned.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from problem import Problem

from spheretwin.models.magnetics import KNEE, NARROW_PER_UNIT, WIDE_PER_UNIT

jax.config.update("jax_enable_x64", True)

CENTRE = KNEE * WIDE_PER_UNIT + (1 - KNEE) * NARROW_PER_UNIT


class Figures(NamedTuple):
    """Figures of a row."""

    max_abs_error_rad: Any  # (3,)
    rms_error_rad: Any  # (3,)


class Trace(NamedTuple):
    """Trace of a row, for the comparison with ours."""

    q_rad: Any  # (ticks, 3)
    current_A: Any  # (ticks, 18), mean over the physics step that begins at the tick


class Turns(NamedTuple):
    """Cosines and sines of a pose."""

    ca: Any
    sa: Any
    cb: Any
    sb: Any
    cg: Any
    sg: Any


def turns(q) -> Turns:
    return Turns(*(jnp.cos(q[0]), jnp.sin(q[0]), jnp.cos(q[1]), jnp.sin(q[1]), jnp.cos(q[2]), jnp.sin(q[2])))


def closed_loop(problem: Problem, law, rotor, traced: bool = False):
    """Return a row as a function of reference, disturbance and inertia: `Figures` or a `Trace`."""
    drive, torque_matrix = problem.drive, torque_matrix_of(problem)

    def tick(carry, inputs):
        state, memory, current, worst, squares = carry
        reference, disturbance = inputs
        q, qdot = rotor.pose(state)
        error = tuple(q[axis] - reference[0, axis] for axis in range(3))
        error_rate = tuple(qdot[axis] - reference[1, axis] for axis in range(3))
        torque, memory = law.step(memory, error, error_rate, q, qdot)
        at = turns(q)
        command = allocated(torque_matrix(at), cartesian(at, torque), drive.current_limit_A)
        for substep in range(problem.substeps):
            before, rate = rotor.pose(state)
            middle = turns(tuple(a + 0.5 * problem.step_s * v for a, v in zip(before, rate, strict=True)))
            mean = command + drive.mean_share * (current - command)
            if substep == 0:
                traces = Trace(jnp.stack(q), mean) if traced else None
            current = command + drive.decay * (current - command)
            torque_q = on_hinges(middle, tuple(jnp.sum(row * mean) for row in torque_matrix(middle)))
            state = rotor.step(state, tuple(torque_q[axis] - disturbance[axis] for axis in range(3)))
        worst = tuple(jnp.maximum(most, jnp.abs(each)) for most, each in zip(worst, error, strict=True))
        squares = tuple(total + each**2 for total, each in zip(squares, error, strict=True))
        return (state, memory, current, worst, squares), traces

    def row(reference, disturbance, inertia):
        nothing = 0.0 * inertia[0]
        none, at_rest = (nothing,) * 3, jnp.zeros(problem.magnetics.sizes["groups"])
        start = rotor.start(tuple(reference[0, 0]), inertia), law.start(), at_rest, none, none
        (*_, worst, squares), traces = jax.lax.scan(tick, start, (reference, disturbance))
        if traced:
            return traces
        return Figures(jnp.stack(worst), jnp.sqrt(jnp.stack(squares) / len(reference)))

    return row


def cartesian(at: Turns, torque_q):
    """``E^-T torque_q``."""
    in_plane = (torque_q[2] - at.sb * torque_q[0]) / at.cb
    return torque_q[0], at.ca * torque_q[1] - at.sa * in_plane, at.sa * torque_q[1] + at.ca * in_plane


def on_hinges(at: Turns, torque_S):
    """``E^T torque_S``."""
    x, y, z = torque_S
    return x, at.ca * y + at.sa * z, at.sb * x + at.cb * (at.ca * z - at.sa * y)


def torque_matrix_of(problem: Problem):
    """Return a function for the rows of the torque matrix, (18,) each, by our table and pole lines."""
    of = problem.magnetics.arrangement[0]
    lines, weights, axes = of.line_axes, of.line_weights, of.group_axes
    cubics = jnp.asarray(problem.magnetics.tables.curve)

    def torque_matrix(at):
        R = (
            (at.cb * at.cg, -at.cb * at.sg, at.sb),
            (at.ca * at.sg + at.sa * at.sb * at.cg, at.ca * at.cg - at.sa * at.sb * at.sg, -at.sa * at.cb),
            (at.sa * at.sg - at.ca * at.sb * at.cg, at.sa * at.cg + at.ca * at.sb * at.sg, at.ca * at.cb),
        )
        x, y, z = (row[0] * lines[:, 0] + row[1] * lines[:, 1] + row[2] * lines[:, 2] for row in R)  # (8,)
        cosine = x[:, None] * axes[0] + y[:, None] * axes[1] + z[:, None] * axes[2]  # (8, 18)
        pull = jnp.stack([x, y, z]) @ (looked_up(cubics, cosine) * weights[:, None])  # (3, 18)
        return (
            pull[1] * axes[2] - pull[2] * axes[1],
            pull[2] * axes[0] - pull[0] * axes[2],
            pull[0] * axes[1] - pull[1] * axes[0],
        )

    return torque_matrix


def looked_up(cubics, cosine):
    beyond = cosine - jnp.clip(cosine, -KNEE, KNEE)
    place = CENTRE + WIDE_PER_UNIT * cosine + (NARROW_PER_UNIT - WIDE_PER_UNIT) * beyond
    cubic = cubics.at[place.astype(jnp.int32)].get(mode="promise_in_bounds")
    t = place - jnp.floor(place)
    return cubic[..., 0] + t * (cubic[..., 1] + t * (cubic[..., 2] + t * cubic[..., 3]))


def allocated(G, torque, limit_A):
    """Least-norm currents, scaled as a whole to respect the limit."""
    x, y, z = G
    a, b, c = jnp.sum(x * x), jnp.sum(x * y), jnp.sum(x * z)
    d, e, f = jnp.sum(y * y), jnp.sum(y * z), jnp.sum(z * z)
    first, second, third = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * first + b * second + c * third
    u, v, w = torque[0] / determinant, torque[1] / determinant, torque[2] / determinant
    current = (
        x * (first * u + second * v + third * w)
        + y * (second * u + (a * f - c * c) * v + (b * c - a * e) * w)
        + z * (third * u + (b * c - a * e) * v + (a * d - b * b) * w)
    )
    return current * jnp.minimum(1.0, limit_A / jnp.maximum(jnp.max(jnp.abs(current)), 1e-300))
