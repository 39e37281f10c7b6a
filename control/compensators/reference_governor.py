r"""Reference governor: limits the acceleration of the reference on each axis.

A law follows a jump of the desired rate only with an error. The governor replaces the jump with a pulse of
bounded acceleration; the law receives the angle, rate and acceleration of that pulse. The governed reference
starts at the measured angles and rates. The error of a run is still the error against the desired motion.

*On a double integrator* whose acceleration u is held over the period h, the angle ε by which the governed
reference leads the desired one moves on by ε⁺ = ε + h ε̇ + ½h² u. As z = ε − ½h ε̇ it reads z⁺ = z + h ε̇,
ε̇⁺ = ε̇ + h u, which is the system that Han's discrete time-optimal feedback fhan(z, ε̇, R, h) takes to rest
(Han, *From PID to active disturbance rejection control*, IEEE Trans. Ind. Electron. 56 (2009) 900-906). From
rest to rest it takes at most one period more than any acceleration within ±R can, and goes beyond its target
by at most R h²/13, a tenth of a microradian at 3 rad/s² and 1 kHz.

*Moving target.* Angle and rate are relative to the desired ones, and the desired acceleration is added:
u = q̈ + fhan(z, ε̇, R − |q̈|, h). The acceleration of the desired motion thus reduces the share of R for
catching up. At least a tenth of R remains, and u is clipped at ±R. A motion within R is followed exactly,
except for its change of acceleration within a period.

*Benefit.* It depends on whether the acceleration becomes torque, by the law itself or by
`feed_forward.inertia`. With a law that does not use the acceleration, the governor alone only delays the
reference. The study `compensators` measures it on the prototype's tilt.
"""

from __future__ import annotations

from math import copysign, isfinite, sqrt

from pydantic import BaseModel, ConfigDict, Field

from spheretwin.control.law import PositiveEach
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.record import Record, Rows, field, put

# Least share of the acceleration for catching up, whatever the desired motion takes.
LEAST_SPARE_SHARE = 0.1


class GovernorSection(BaseModel):
    """Reference governor; off unless an acceleration is given."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    acceleration_rad_s2: PositiveEach | None = Field(
        None,
        description="largest acceleration of the reference that the law receives, rad/s²; unbounded unless"
        " given",
    )

    @property
    def on(self) -> bool:
        """True if an acceleration is given."""
        return self.acceleration_rad_s2 is not None


class Governor(Record):
    """Governor of a run."""

    on: bool = field("whether the governor is on")
    largest_rad_s2: Array = field("largest acceleration", "rad/s²", 3)
    period_s: float = field("control period", "s")
    motion: Array = field(
        "angle, rate, acceleration of the governed reference as rows", "", (3, 3), state=True
    )
    started: bool = field("whether the governed reference has begun", state=True)


def fill_governor(rows: Rows, section: GovernorSection, period_s: float) -> None:
    """Fill governors before the first tick."""
    given = section.acceleration_rad_s2
    put(rows, on=section.on, period_s=period_s, largest_rad_s2=1.0 if given is None else given)


@allocation_free
def govern(governor: Governor, measurement: Array, reference: Array) -> bool:
    """Replace the desired reference with the governed reference of this tick.

    Parameters
    ----------
    governor : Governor
        Changed in place.
    measurement : (3, 3) array
        Angle and rate as rows; start of the governed reference.
    reference : (3, 3) array
        Desired angle, rate and acceleration as rows; replaced by the governed ones.

    Returns
    -------
    bool
        True if the result is finite; otherwise the governor starts again at the next tick.
    """
    motion, h = governor.motion, governor.period_s
    finite = True
    for axis in range(3):
        if not governor.started:
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
    governor.started = finite
    if not finite:
        for axis in range(3):
            motion[0, axis] = motion[1, axis] = motion[2, axis] = 0.0
    return finite


@allocation_free
def fhan(x: float, v: float, largest: float, h: float) -> float:
    """Return the acceleration within ±`largest` that takes ``x+ = x + h v, v+ = v + h u`` to rest at 0.

    The time to rest is nearly minimal.

    Within two periods of rest it is the dead-beat feedback ``-(x + 2 h v) / h²``.
    """
    reach = largest * h * h  # displacement of one period at the largest acceleration
    after = x + h * v
    if abs(after) <= reach:
        switching = h * v + after
    else:
        switching = h * v + copysign(0.5, after) * (sqrt(reach * (reach + 8.0 * abs(after))) - reach)
    return -largest * min(max(switching / reach, -1.0), 1.0)
