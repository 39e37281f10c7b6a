"""Reference trajectories: desired angles, rates and accelerations of the three hinges."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

# Far beyond any motion of the actuator, and far from where squares of numbers overflow.
LARGEST = 1e4

Bounded = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Triple = tuple[Bounded, Bounded, Bounded]
Samples = NDArray[np.float64]


class _Trajectory(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def sample(self, t: NDArray[np.float64]) -> Samples:
        """Desired motion at times `t` (s).

        Returns
        -------
        (n, 3, 3) array
            Angle (rad), rate (rad/s) and acceleration (rad/s²) as rows, for each time.
        """
        raise NotImplementedError


class Sinusoid(_Trajectory):
    """``amplitude sin(2 pi f t)`` on each axis (paper section 4.1; its amplitude is not printed)."""

    shape: Literal["sinusoid"] = Field("sinusoid", description="kind of trajectory")
    amplitude_rad: Triple = Field((0.2, 0.2, 0.2), description="amplitude on each axis, rad")
    frequency_Hz: Annotated[float, Field(gt=0, le=LARGEST)] = Field(0.5, description="frequency, Hz")

    def sample(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        w = 2 * np.pi * self.frequency_Hz
        phase = (w * t)[:, None, None]
        rows = np.concatenate([np.sin(phase), w * np.cos(phase), -(w**2) * np.sin(phase)], axis=1)
        return rows * np.array(self.amplitude_rad)  # (n, 3, 3)


class Nutation(_Trajectory):
    """``[a sin(pi t), b t cos(pi t), 2 pi t]``: a gyration that widens while the rotor spins (59)."""

    shape: Literal["nutation"] = Field("nutation", description="kind of trajectory")
    alpha_amplitude_rad: Bounded = Field(0.2, description="amplitude of α, rad")
    beta_growth_rad_s: Bounded = Field(0.2, description="growth of the amplitude of β, rad/s")
    spin_rate_rad_s: Bounded = Field(2 * np.pi, description="rate of γ, rad/s")

    def sample(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        pi, a, b = np.pi, self.alpha_amplitude_rad, self.beta_growth_rad_s
        sine, cosine = np.sin(pi * t), np.cos(pi * t)
        spin = np.full_like(t, self.spin_rate_rad_s)
        angle = [a * sine, b * t * cosine, spin * t]
        rate = [a * pi * cosine, b * (cosine - pi * t * sine), spin]
        alpha_acceleration = -a * pi**2 * sine
        beta_acceleration = -b * pi * (2 * sine + pi * t * cosine)
        acceleration = [alpha_acceleration, beta_acceleration, np.zeros_like(t)]
        return np.stack([np.stack(row, axis=1) for row in (angle, rate, acceleration)], axis=1)


class Tilt(_Trajectory):
    """Rise at a steady rate, hold, fall; the other hinges stay at 0 (60)."""

    shape: Literal["tilt"] = Field("tilt", description="kind of trajectory")
    rate_rad_s: Bounded = Field(np.pi / 30, description="rate of α while rising, rad/s")
    phase_s: Annotated[float, Field(gt=0, le=LARGEST)] = Field(
        2.0, description="length of rise, hold and fall each, s"
    )

    def sample(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        rising, falling = t < self.phase_s, (t >= 2 * self.phase_s) & (t < 3 * self.phase_s)
        samples = np.zeros((len(t), 3, 3))
        corners = self.phase_s * np.arange(4)
        samples[:, 0, 0] = np.interp(t, corners, self.rate_rad_s * self.phase_s * np.array([0, 1, 1, 0]))
        samples[:, 1, 0] = self.rate_rad_s * (rising.astype(float) - falling)
        return samples


class Hold(_Trajectory):
    """One pose throughout: with another starting pose, a step response."""

    shape: Literal["hold"] = Field("hold", description="kind of trajectory")
    angle_rad: Triple = Field((0.0, 0.0, 0.0), description="pose to hold, rad")

    def sample(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        samples = np.zeros((len(t), 3, 3))
        samples[:, 0] = self.angle_rad
        return samples


Trajectory = Annotated[Sinusoid | Nutation | Tilt | Hold, Field(discriminator="shape")]
