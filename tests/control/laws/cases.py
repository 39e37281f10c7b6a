"""What tests of laws share: a law called as the loop calls it, beside a slow copy, and on one axis alone."""

from itertools import count

import numba
import numpy as np

from spheretwin.control.controller import call_law
from spheretwin.control.law import SIGNATURE, NominalModel
from spheretwin.models.base.compiled import compiled_callback

PERIOD = 1e-3
TICKS = 200
WEAK = {
    "plant.engine": "lagrangian",
    "disturbance.load": 0.0,
    "drive.current_limit_A": 2.0,
    "nominal.current_limit_A": 2.0,
}
"""Currents that give a fifth of the torque that a step of the reference requires."""


@numba.njit
def by_address(address, t, reference, measurement, parameters, state, torque):
    """Call a law as the loop does: its machine code."""
    call_law(address, t, reference, measurement, parameters, state, torque)


def machine_code(law):
    """Return the machine code of a law as a function of reference and measurement, and the law's state."""
    compiled = compiled_callback(SIGNATURE, law.step)  # called as a function, it would run as Python
    state, torque, ticks = law.state.copy(), np.empty(3), count()

    def call(reference, measurement):
        t = PERIOD * next(ticks)
        by_address(compiled.address, t, reference, measurement, law.parameters, state, torque)
        return torque

    return call, state


def known(actuator, delay_s=0.0, period_s=PERIOD):
    return NominalModel(period_s, delay_s, actuator.inertia)


def follows(law, slow):
    """Hold the torque and what is logged of a law's machine code against a slow copy, on random inputs."""
    call, state = machine_code(law)
    generator = np.random.default_rng(0)
    for _ in range(TICKS):
        reference, measurement = generator.normal(size=(3, 3)), generator.normal(size=(3, 3))
        torque = call(reference, measurement)
        wanted, logged = slow(reference, measurement)
        # Sums of some hundred numbers, rounded by 1e-16 of the largest each.
        np.testing.assert_allclose(torque, wanted, rtol=1e-11, atol=1e-11 * np.abs(wanted).max())
        np.testing.assert_allclose(state[: len(logged)], logged, rtol=1e-11, atol=1e-11)


def regressor(rate, angle):
    """Return the regressor of the paper's approximator (34), (57): normalised products of Gaussians first."""
    centres = np.array([-3, -1.5, 0, 1.5, 3])
    products = np.outer(*(np.exp(-0.5 * ((x - centres) / 2) ** 2) for x in (rate, angle))).ravel()
    return np.outer([1, rate, angle], products / products.sum()).ravel()


class Asked:
    """Torques that were asked for, as old as the known delay, from all that there ever were."""

    def __init__(self, delay_s):
        self.whole, self.late = divmod(delay_s / PERIOD, 1)
        self.all = [np.zeros(3)]

    def __call__(self):
        older, newer = (self._at(int(self.whole) + more) for more in (1, 0))
        return self.late * older + (1 - self.late) * newer

    def _at(self, periods):
        return self.all[-1 - periods] if periods < len(self.all) else np.zeros(3)


class SlowIntegral:
    """Slow copy of a law with a torque (N·m) that is integrated, and tracks what was applied."""

    def __init__(self, gains, inertia, delay_s):
        self.gains, self.J, self.asked = gains, inertia, Asked(delay_s)
        self.integral = np.zeros(3)

    def named(self, *names):
        """Gains of each axis by name."""
        return [np.array(getattr(self.gains, name)) for name in names]


UNDISTURBED = {
    "plant.engine": "lagrangian", "plant.step_s": 2.5e-4, "plant.modelling_error": 0.0,
    "plant.modelling_torque_Nm": [0.0, 0.0, 0.0], "disturbance.load": 0.0,
    "disturbance.random_bound_Nm": 0.0, "drive.time_constant_s": 0.0,
}  # fmt: skip
"""A plant that is as the nominal model has it, and acts at once."""


def on_an_axis(law, inertia, start, seconds, period_s, load_Nm=0.0):
    """Course of (error, rate, first logged) of β at rest on the others: a double integrator, stepped exactly.

    At α = γ = 0 the inertia matrix of β alone is J2 and nothing couples, so that the model is the plant.
    """
    state, torque = law.state.copy(), np.zeros(3)
    angle, rate = start
    course = []
    for _ in range(round(seconds / period_s)):
        measurement = np.zeros((3, 3))
        measurement[:2, 1], measurement[2] = (angle, rate), torque
        law.step(0.0, np.zeros((3, 3)), measurement, law.parameters, state, torque)
        course.append((angle, rate, *state[1 : len(law.state) : 3]))
        push = (torque[1] - load_Nm) / inertia[1]
        angle, rate = angle + period_s * rate + 0.5 * period_s**2 * push, rate + period_s * push
    return np.array([row[:4] for row in course])
