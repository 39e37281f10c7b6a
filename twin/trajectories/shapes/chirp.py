"""A sine whose frequency sweeps."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.twin.trajectories.trajectory import LARGEST, Samples, Shape, Triple

Frequency = Annotated[float, Field(ge=1e-9, le=LARGEST)]


class Chirp(Shape):
    """``amplitude sin(phi(t))`` on each axis; after the sweep it goes on at the last frequency."""

    shape: Literal["chirp"] = Field("chirp", description="kind of trajectory")
    amplitude_rad: Triple = Field((0.1, 0.1, 0.1), description="amplitude on each axis, rad")
    start_frequency_Hz: Frequency = Field(0.1, description="frequency at 0 s, Hz")
    end_frequency_Hz: Frequency = Field(2.0, description="frequency from the end of the sweep on, Hz")
    sweep_s: Annotated[float, Field(gt=0, le=LARGEST)] = Field(10.0, description="length of the sweep, s")
    sweep: Literal["linear", "exponential"] = Field(
        "linear", description="frequency grows by equal differences, or by equal ratios, in equal times"
    )

    def sharp(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        swept, beyond = np.minimum(t, self.sweep_s), np.maximum(t - self.sweep_s, 0.0)
        turns, frequency, growth = self._swept(swept)
        phase = 2 * np.pi * (turns + self.end_frequency_Hz * beyond)
        w = 2 * np.pi * frequency
        dw = np.where(t < self.sweep_s, 2 * np.pi * growth, 0.0)
        rows = [np.sin(phase), w * np.cos(phase), dw * np.cos(phase) - w**2 * np.sin(phase)]
        return np.stack(rows, axis=1)[:, :, None] * np.array(self.amplitude_rad)  # (n, 3, 3)

    def _swept(self, t: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Turns done (1), frequency (Hz) and its growth (Hz/s) at times within the sweep."""
        first, last, length = self.start_frequency_Hz, self.end_frequency_Hz, self.sweep_s
        if self.sweep == "linear" or first == last:
            slope = (last - first) / length
            return first * t + 0.5 * slope * t**2, first + slope * t, np.full_like(t, slope)
        rate = np.log(last / first) / length
        frequency = first * np.exp(rate * t)
        return first * np.expm1(rate * t) / rate, frequency, rate * frequency
