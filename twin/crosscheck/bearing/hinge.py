"""One hinge with friction, three ways: our stage of it, MuJoCo's own, and the ideal that both stand for.

The hinge is γ of the upright rotor, whose inertia is J3 and which no other hinge pulls along; gravity is off.
Ideal friction opposes a motion by ``coulomb + viscous v`` and holds whatever is pushed by less than the
Coulomb level. Neither way can: what is to hold at rest has to follow from a rate. Both creep below the level.

Our stage is smooth over a stated rate and acts by halves around each step (`plant.friction`). MuJoCo's
friction loss is a soft constraint on the rate, without a position: where its force F is below the level, it
is that which leaves the acceleration ``a = (1 - d) a0 - d b v``, with a0 that without the constraint, the
impedance d at no violation and the damping b of its reference, which is ``2 / (dmax timeconst)``. With a0 =
(T - viscous v) / J the hinge relaxes at the rate ``d b + (1 - d) viscous / J`` to the creep at which
``F = d b J v / (1 - d)``.
"""

from __future__ import annotations

from math import inf, log1p
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_s = 5e-4  # the default physics step
BISECTIONS = 100  # a double has 52 bits; the bracket is up to a few thousand rates wide

# What MuJoCo gives a friction loss that says nothing else: time constant and damping ratio of its reference;
# impedance at no violation and at a large one, and how it rises between.
TIME_CONSTANT_s, DAMPING_RATIO = 0.02, 1.0
IMPEDANCE, LARGEST_IMPEDANCE = 0.9, 0.95
RISE = (0.001, 0.5, 2.0)

REFERENCE_DAMPING_1_s = 2 / (LARGEST_IMPEDANCE * TIME_CONSTANT_s)


class Hinge(NamedTuple):
    """A hinge and its bearing."""

    inertia_kgm2: float
    coulomb_Nm: float
    viscous_Nm_s: float
    smoothing_rad_s: float
    """Rate over which our stage changes sign."""

    def ideal_time_s(self, rate_rad_s: float, to_rad_s: float = 0.0) -> float:
        """Time in which ideal friction slows the hinge from one rate to another."""
        C, c = self.coulomb_Nm, self.viscous_Nm_s
        return self.inertia_kgm2 / c * (log1p(c * rate_rad_s / C) - log1p(c * to_rad_s / C))

    def ideal_angle_rad(self, rate_rad_s: float) -> float:
        """Angle over which ideal friction stops the hinge, the integral of its equation of motion."""
        momentum = self.inertia_kgm2 * rate_rad_s
        return (momentum - self.coulomb_Nm * self.ideal_time_s(rate_rad_s)) / self.viscous_Nm_s

    def ideal_coast_rad_s(self, t_s: Array, rate_rad_s: float) -> Array:
        """(n,) rate under ideal friction alone."""
        final = self.coulomb_Nm / self.viscous_Nm_s
        decay = self.viscous_Nm_s / self.inertia_kgm2
        return np.maximum((rate_rad_s + final) * np.exp(-decay * t_s) - final, 0.0)

    def factor_at_rest_Nm_s(self) -> float:
        """Our stage over the rate, at rest."""
        return self.viscous_Nm_s + self.coulomb_Nm / self.smoothing_rad_s

    def slowed_rad_s(self, rate_rad_s: Array) -> Array:
        """Rate after half a step of our stage alone."""
        share = 0.5 * STEP_s / self.inertia_kgm2
        middle = rate_rad_s / (1 + 0.5 * share * self._factor_Nm_s(rate_rad_s))
        x = share * self._factor_Nm_s(middle)
        slowed: Array = rate_rad_s / (1 + x + 0.5 * x**2)
        return slowed

    def stage_Nm(self, rate_rad_s: Array) -> Array:
        """Torque under which our stage creeps at a rate, from the end of one step to that of the next.

        Half a step of friction takes the rate v to P(v), the torque adds h T/J, and the other half takes that
        back to v. P rises with the rate; bisection inverts it.
        """
        x = 0.5 * STEP_s / self.inertia_kgm2 * self.factor_at_rest_Nm_s()
        low, high = rate_rad_s, rate_rad_s * (1 + x + 0.5 * x**2)
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            too_low = self.slowed_rad_s(middle) < rate_rad_s
            low, high = np.where(too_low, middle, low), np.where(too_low, high, middle)
        torque: Array = self.inertia_kgm2 / STEP_s * (high - self.slowed_rad_s(rate_rad_s))
        return torque

    def _factor_Nm_s(self, rate_rad_s: Array) -> Array:
        factor: Array = self.viscous_Nm_s + self.coulomb_Nm / np.hypot(rate_rad_s, self.smoothing_rad_s)
        return factor

    def stage_loss_rad_s(self) -> float:
        """Rate that Coulomb friction takes in half a step."""
        return 0.5 * STEP_s * self.coulomb_Nm / self.inertia_kgm2

    def mujoco_Nm(self, rate_rad_s: Array) -> Array:
        """Torque that creeps at a rate under MuJoCo's friction loss and damping."""
        level = np.minimum(self.coulomb_Nm, self.mujoco_soft_Nm_s() * rate_rad_s)
        held: Array = self.viscous_Nm_s * rate_rad_s + level
        return held

    def mujoco_soft_Nm_s(self) -> float:
        """MuJoCo's friction loss over the rate of its creep, below the level."""
        return REFERENCE_DAMPING_1_s * IMPEDANCE / (1 - IMPEDANCE) * self.inertia_kgm2

    def mujoco_relaxation_1_s(self) -> float:
        """Rate at which a motion dies out within MuJoCo's friction loss."""
        viscous = self.viscous_Nm_s / self.inertia_kgm2
        return IMPEDANCE * REFERENCE_DAMPING_1_s + (1 - IMPEDANCE) * viscous

    def mujoco_grip_rad_s(self) -> float:
        """Rate from which on MuJoCo's friction loss no longer brakes by its level, where nothing else acts.

        There ``a = -mujoco_relaxation_1_s v``, so that the force is ``d (b J - viscous) v``.
        """
        gained = REFERENCE_DAMPING_1_s * self.inertia_kgm2 - self.viscous_Nm_s
        return self.coulomb_Nm / (IMPEDANCE * gained) if gained > 0 else inf

    def relaxation_s(self) -> float:
        """Time in which a third is left of a motion below the level, either way.

        A step of ours leaves ``1 / (1 + x + x**2 / 2)**2`` of a rate, ``x = h k / 2J``: less than an implicit
        Euler step, ``1 / (1 + h k / J)``, whose time is J/k + h.
        """
        own = self.inertia_kgm2 / self.factor_at_rest_Nm_s() + STEP_s
        return max(own, 1 / self.mujoco_relaxation_1_s())
