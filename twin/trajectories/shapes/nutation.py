"""The nutation of the paper."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.twin.trajectories.trajectory import Bounded, Samples, Shape


class Nutation(Shape):
    """``[a sin(pi t), b t cos(pi t), 2 pi t]``: a gyration that widens while the rotor spins (59)."""

    shape: Literal["nutation"] = Field("nutation", description="kind of trajectory")
    alpha_amplitude_rad: Bounded = Field(0.2, description="amplitude of α, rad")
    beta_growth_rad_s: Bounded = Field(0.2, description="growth of the amplitude of β, rad/s")
    spin_rate_rad_s: Bounded = Field(2 * np.pi, description="rate of γ, rad/s")

    def sharp(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        pi, a, b = np.pi, self.alpha_amplitude_rad, self.beta_growth_rad_s
        sine, cosine = np.sin(pi * t), np.cos(pi * t)
        spin = np.full_like(t, self.spin_rate_rad_s)
        angle = [a * sine, b * t * cosine, spin * t]
        rate = [a * pi * cosine, b * (cosine - pi * t * sine), spin]
        alpha_acceleration = -a * pi**2 * sine
        beta_acceleration = -b * pi * (2 * sine + pi * t * cosine)
        acceleration = [alpha_acceleration, beta_acceleration, np.zeros_like(t)]
        return np.stack([np.stack(row, axis=1) for row in (angle, rate, acceleration)], axis=1)
