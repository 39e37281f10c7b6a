"""Shapes of reference trajectories."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from spheretwin.models.telemetry.csv_series import TimeSeries, check_rising, reached
from spheretwin.trajectories.rounding import CONFIG, LARGEST, ZERO, Bounded, Corners, Time, Triple
from spheretwin.trajectories.trajectory import Samples, Shape

Frequency = Annotated[float, Field(ge=1e-9, le=LARGEST)]


class Chirp(Shape):
    """``amplitude sin(phi(t))`` on each axis; after the sweep the last frequency continues."""

    shape: Literal["chirp"] = Field("chirp", description="kind of trajectory")
    amplitude_rad: Triple = Field((0.1, 0.1, 0.1), description="amplitude on each axis, rad")
    start_frequency_Hz: Frequency = Field(0.1, description="frequency at 0 s, Hz")
    end_frequency_Hz: Frequency = Field(2.0, description="frequency from the end of the sweep on, Hz")
    sweep_s: Annotated[float, Field(gt=0, le=LARGEST)] = Field(10.0, description="length of the sweep, s")
    sweep: Literal["linear", "exponential"] = Field(
        "linear", description="frequency grows by equal differences, or by equal ratios, in equal times"
    )

    def sharp(self, t: NDArray[np.float64]) -> Samples:
        """Return the motion without rounded corners, as `Shape.sharp`."""
        swept, beyond = np.minimum(t, self.sweep_s), np.maximum(t - self.sweep_s, 0.0)
        turns, frequency, growth = self._swept(swept)
        phase = 2 * np.pi * (turns + self.end_frequency_Hz * beyond)
        w = 2 * np.pi * frequency
        dw = np.where(t < self.sweep_s, 2 * np.pi * growth, 0.0)
        rows = [np.sin(phase), w * np.cos(phase), dw * np.cos(phase) - w**2 * np.sin(phase)]
        return np.stack(rows, axis=1)[:, :, None] * np.array(self.amplitude_rad)  # (n, 3, 3)

    def _swept(self, t: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Return turns (1), frequency (Hz) and its growth (Hz/s) at times within the sweep."""
        first, last, length = self.start_frequency_Hz, self.end_frequency_Hz, self.sweep_s
        if self.sweep == "linear" or first == last:
            slope = (last - first) / length
            return first * t + 0.5 * slope * t**2, first + slope * t, np.full_like(t, slope)
        rate = np.log(last / first) / length
        frequency = first * np.exp(rate * t)
        return first * np.expm1(rate * t) / rate, frequency, rate * frequency


class Hold(Shape):
    """Constant pose; with another initial pose it gives a step response."""

    shape: Literal["hold"] = Field("hold", description="kind of trajectory")
    angle_rad: Triple = Field(ZERO, description="pose to hold, rad")

    def sharp(self, t: NDArray[np.float64]) -> Samples:
        """Return the motion without rounded corners, as `Shape.sharp`."""
        samples = np.zeros((len(t), 3, 3))
        samples[:, 0] = self.angle_rad
        return samples


Farthest = Annotated[float, Field(gt=0, le=LARGEST)]


class Jog(Shape):
    """Constant rates of all hinges, until α or β reaches its limit."""

    shape: Literal["jog"] = Field("jog", description="kind of trajectory")
    start_rad: Triple = Field(ZERO, description="pose at the start, rad")
    rate_rad_s: tuple[Bounded, Bounded, Bounded] = Field((0.0, 0.0, 0.5), description="rates, rad/s")
    farthest_rad: Farthest = Field(
        1.3, description="largest angle of α and β, rad; a hinge that starts beyond it may only turn back"
    )

    def sharp(self, t: NDArray[np.float64]) -> Samples:
        """Return the motion without rounded corners, as `Shape.sharp`."""
        samples = np.zeros((len(t), 3, 3))
        moving = t[:, None] < self._ends_s()
        samples[:, 0] = self.start_rad + np.array(self.rate_rad_s) * np.minimum(t[:, None], self._ends_s())
        samples[:, 1] = np.where(moving, self.rate_rad_s, 0.0)
        return samples

    def corners(self) -> Corners:
        """Return the corners of the motion, as `Shape.corners`."""
        ends = self._ends_s()
        axes = [axis for axis in np.argsort(ends, kind="stable") if 0 < ends[axis] < np.inf]
        jumps = np.zeros((len(axes), 3))
        jumps[np.arange(len(axes)), axes] = -np.array(self.rate_rad_s)[axes]
        return Corners(ends[axes], np.zeros_like(jumps), jumps)

    def _ends_s(self) -> NDArray[np.float64]:
        """Return the times (3,) at which the hinges stop; infinite for γ and for a hinge at rest."""
        ends = np.full(3, np.inf)
        for axis in range(2):
            rate = self.rate_rad_s[axis]
            if rate != 0:
                ends[axis] = max(0.0, (self.farthest_rad - np.sign(rate) * self.start_rad[axis]) / abs(rate))
        return ends


ComponentFrequency = Annotated[float, Field(ge=0, le=LARGEST)]


class Component(BaseModel):
    """One sine of each axis: ``amplitude sin(2 pi f t + phase)``."""

    model_config = CONFIG

    amplitude_rad: Triple = Field((0.1, 0.1, 0.1), description="amplitude on each axis, rad")
    frequency_Hz: tuple[ComponentFrequency, ComponentFrequency, ComponentFrequency] = Field(
        (0.5, 0.5, 0.5), description="frequency on each axis, Hz"
    )
    phase_rad: Triple = Field(ZERO, description="phase on each axis at 0 s, rad")


class Multisine(Shape):
    """Pose plus sines; in a file, each sine is a table ``[[trajectory.components]]``."""

    shape: Literal["multisine"] = Field("multisine", description="kind of trajectory")
    offset_rad: Triple = Field(ZERO, description="mean pose of the sines, rad")
    components: Annotated[tuple[Component, ...], Field(min_length=1)] = Field(
        (Component(),),
        description="sines to be added: amplitude_rad, frequency_Hz and phase_rad of each axis",
    )

    def sharp(self, t: NDArray[np.float64]) -> Samples:
        """Return the motion without rounded corners, as `Shape.sharp`."""
        samples = np.zeros((len(t), 3, 3))
        samples[:, 0] = self.offset_rad
        for component in self.components:
            amplitude, w = np.array(component.amplitude_rad), 2 * np.pi * np.array(component.frequency_Hz)
            phase = t[:, None] * w + np.array(component.phase_rad)
            samples[:, 0] += amplitude * np.sin(phase)
            samples[:, 1] += amplitude * w * np.cos(phase)
            samples[:, 2] -= amplitude * w**2 * np.sin(phase)
        return samples


class Nutation(Shape):
    """``[a sin(pi t), b t cos(pi t), 2 pi t]``: a gyration that widens while the rotor spins (59)."""

    shape: Literal["nutation"] = Field("nutation", description="kind of trajectory")
    alpha_amplitude_rad: Bounded = Field(0.2, description="amplitude of α, rad")
    beta_growth_rad_s: Bounded = Field(0.2, description="growth of the amplitude of β, rad/s")
    spin_rate_rad_s: Bounded = Field(2 * np.pi, description="rate of γ, rad/s")

    def sharp(self, t: NDArray[np.float64]) -> Samples:
        """Return the motion without rounded corners, as `Shape.sharp`."""
        pi, a, b = np.pi, self.alpha_amplitude_rad, self.beta_growth_rad_s
        sine, cosine = np.sin(pi * t), np.cos(pi * t)
        spin = np.full_like(t, self.spin_rate_rad_s)
        angle = [a * sine, b * t * cosine, spin * t]
        rate = [a * pi * cosine, b * (cosine - pi * t * sine), spin]
        alpha_acceleration = -a * pi**2 * sine
        beta_acceleration = -b * pi * (2 * sine + pi * t * cosine)
        acceleration = [alpha_acceleration, beta_acceleration, np.zeros_like(t)]
        return np.stack([np.stack(row, axis=1) for row in (angle, rate, acceleration)], axis=1)


class Sinusoid(Shape):
    """``amplitude sin(2 pi f t)`` on each axis (paper section 4.1; its amplitude is not printed)."""

    shape: Literal["sinusoid"] = Field("sinusoid", description="kind of trajectory")
    amplitude_rad: Triple = Field((0.2, 0.2, 0.2), description="amplitude on each axis, rad")
    frequency_Hz: Annotated[float, Field(gt=0, le=LARGEST)] = Field(0.5, description="frequency, Hz")

    def sharp(self, t: NDArray[np.float64]) -> Samples:
        """Return the motion without rounded corners, as `Shape.sharp`."""
        w = 2 * np.pi * self.frequency_Hz
        phase = (w * t)[:, None, None]
        rows = np.concatenate([np.sin(phase), w * np.cos(phase), -(w**2) * np.sin(phase)], axis=1)
        return rows * np.array(self.amplitude_rad)  # (n, 3, 3)


class Steps(Shape):
    """Poses from stated times on; rates and accelerations are 0."""

    shape: Literal["steps"] = Field("steps", description="kind of trajectory")
    start_rad: Triple = Field(ZERO, description="pose before the first step, rad")
    times_s: Annotated[tuple[Time, ...], Field(min_length=1)] = Field(
        (1.0,), description="times of the steps, rising, s"
    )
    angles_rad: tuple[Triple, ...] = Field(
        ((0.2, -0.1, 0.3),), description="pose from each of these times on, rad"
    )

    def sharp(self, t: NDArray[np.float64]) -> Samples:
        """Return the motion without rounded corners, as `Shape.sharp`."""
        samples = np.zeros((len(t), 3, 3))
        samples[:, 0] = TimeSeries(np.array(self.times_s), np.array(self.angles_rad)).zero_order_hold(
            t, self.start_rad
        )
        return samples

    def corners(self) -> Corners:
        """Return the corners of the motion, as `Shape.corners`."""
        jumps = np.diff(np.array([self.start_rad, *self.angles_rad]), axis=0)
        return Corners(reached(np.array(self.times_s)), jumps, np.zeros_like(jumps))

    def _check(self) -> None:
        if len(self.times_s) != len(self.angles_rad):
            raise ValueError(
                f"expected as many angles_rad as times_s, received {len(self.angles_rad)}"
                f" for {len(self.times_s)} times"
            )
        check_rising(self.times_s)


class Tilt(Shape):
    """Rise at a constant rate, hold, fall; the other hinges stay at 0 (60)."""

    shape: Literal["tilt"] = Field("tilt", description="kind of trajectory")
    rate_rad_s: Bounded = Field(np.pi / 30, description="rate of α while rising, rad/s")
    phase_s: Annotated[float, Field(gt=0, le=LARGEST)] = Field(
        2.0, description="length of rise, hold and fall each, s"
    )

    def sharp(self, t: NDArray[np.float64]) -> Samples:
        """Return the motion without rounded corners, as `Shape.sharp`."""
        rising, falling = t < self.phase_s, (t >= 2 * self.phase_s) & (t < 3 * self.phase_s)
        samples = np.zeros((len(t), 3, 3))
        corners = self.phase_s * np.arange(4)
        samples[:, 0, 0] = np.interp(t, corners, self.rate_rad_s * self.phase_s * np.array([0, 1, 1, 0]))
        samples[:, 1, 0] = self.rate_rad_s * (rising.astype(float) - falling)
        return samples

    def corners(self) -> Corners:
        """Return the corners of the motion, as `Shape.corners`."""
        jumps = np.zeros((3, 3))
        jumps[:, 0] = self.rate_rad_s * np.array([-1, -1, 1])
        return Corners(self.phase_s * np.arange(1, 4, dtype=np.float64), np.zeros((3, 3)), jumps)
