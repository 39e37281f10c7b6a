r"""The governed reference: the way to the desired motion on which no axis exceeds a stated acceleration.

A law can follow a jump of the desired rate only with an error. The governor meets such a jump by a pulse of
bounded acceleration, whose angle, rate and acceleration the law is handed instead. It begins where the rotor
is measured to be; the error of a run stays that against the desired motion.

*On a double integrator* whose acceleration u is held over the period h, the angle ε by which the governed
reference leads the desired one moves on by ε⁺ = ε + h ε̇ + ½h² u. As z = ε − ½h ε̇ it reads z⁺ = z + h ε̇,
ε̇⁺ = ε̇ + h u, which is the system that Han's discrete time-optimal feedback fhan(z, ε̇, R, h) takes to rest
(Han, *From PID to active disturbance rejection control*, IEEE Trans. Ind. Electron. 56 (2009) 900-906). From
rest to rest it takes at most one period more than any acceleration within ±R can, and goes beyond its target
by at most R h²/13, a tenth of a microradian at 3 rad/s² and 1 kHz.

*A target that moves.* Angle and rate are taken against those desired, and the acceleration desired is added:
u = q̈ + fhan(z, ε̇, R − |q̈|, h). What the desired motion itself takes of R is thus not left for catching up;
where it takes nearly all, a tenth of R is, and u is cut at ±R. A motion within R is followed exactly, but for
its change of acceleration within a period.

*What it is worth* depends on whether the acceleration becomes torque: by the law itself, or by
`feed_forward.inertia`. Alone, around a law that makes no use of the acceleration, the governor only holds the
reference back. The study `compensators` measures it on the prototype's tilt.
"""

from __future__ import annotations

from math import copysign, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.control.law import PositiveEach
from spheretwin.models.base.compiled import allocation_free, transfer_state

Array = NDArray[np.float64]

# Share of the acceleration that is left for catching up, however much the desired motion takes.
LEAST_SPARE_SHARE = 0.1


class GovernorSection(BaseModel):
    """Governor of the reference; off unless told how much it may accelerate."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    acceleration_rad_s2: PositiveEach | None = Field(
        None,
        description="largest acceleration of the reference that the law is handed, rad/s²; unbounded unless"
        " given",
    )

    @property
    def on(self) -> bool:
        """Whether there is one."""
        return self.acceleration_rad_s2 is not None


class Governor(NamedTuple):
    """Governor of a run, for compiled code."""

    on: bool
    largest_rad_s2: Array  # (3,)
    period_s: float
    motion: Array  # (3, 3) angle, rate, acceleration as rows: where it is, and what it does from there
    started: Array  # (1,) whether it is anywhere

    def state_arrays(self) -> tuple[Array, ...]:
        """Arrays that it goes on from."""
        return self.motion, self.started


def governor(section: GovernorSection, period_s: float) -> Governor:
    """Governor that has not begun."""
    largest = np.array(section.acceleration_rad_s2 or (1.0, 1.0, 1.0))
    return Governor(section.on, largest, period_s, np.zeros((3, 3)), np.zeros(1))


@allocation_free
def govern(governor: Governor, measurement: Array, reference: Array) -> bool:
    """Put the governed reference of this tick in the place of the desired one.

    Parameters
    ----------
    governor : Governor
        Changed in place.
    measurement : (3, 3) array
        Angle and rate as rows; where it begins.
    reference : (3, 3) array
        Desired angle, rate and acceleration as rows; those governed, as a result.

    Returns
    -------
    bool
        Whether these are numbers; where not, it begins anew at the next tick.
    """
    motion, h = governor.motion, governor.period_s
    finite = True
    for axis in range(3):
        if governor.started[0] == 0.0:
            motion[0, axis], motion[1, axis] = measurement[0, axis], measurement[1, axis]
        else:
            motion[0, axis] += h * (motion[1, axis] + 0.5 * h * motion[2, axis])
            motion[1, axis] += h * motion[2, axis]
        largest, acceleration = governor.largest_rad_s2[axis], reference[2, axis]
        spare = max(largest - abs(acceleration), LEAST_SPARE_SHARE * largest)
        angle_error, rate_error = motion[0, axis] - reference[0, axis], motion[1, axis] - reference[1, axis]
        acceleration += fhan(angle_error - 0.5 * h * rate_error, rate_error, spare, h)
        motion[2, axis] = min(max(acceleration, -largest), largest)
        for row in range(3):
            finite = finite and isfinite(motion[row, axis])
            reference[row, axis] = motion[row, axis]
    governor.started[0] = 1.0
    if not finite:
        governor.started[0] = 0.0
        for axis in range(3):
            motion[0, axis] = motion[1, axis] = motion[2, axis] = 0.0
    return finite


@allocation_free
def fhan(x: float, v: float, largest: float, h: float) -> float:
    """Acceleration within ±`largest` that takes ``x+ = x + h v, v+ = v + h u`` to rest at 0, near soonest.

    Within two periods of rest it is the dead-beat feedback ``-(x + 2 h v) / h²``.
    """
    reach = largest * h * h  # how far a period at the largest acceleration moves it
    after = x + h * v
    if abs(after) <= reach:
        switching = h * v + after
    else:
        switching = h * v + copysign(0.5, after) * (sqrt(reach * (reach + 8.0 * abs(after))) - reach)
    return -largest * min(max(switching / reach, -1.0), 1.0)


def transfer_governor(before: Governor, after: Governor) -> None:
    """Go on from where it was, with other figures; one that was off begins at the next tick."""
    if before.on and after.on:
        transfer_state(before, after)
