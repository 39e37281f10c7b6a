"""Noise and delay of what a policy observes; end and reward are those of the true motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.policy import BOUNDS
from spheretwin.envs.settings import Settings

Array = NDArray[np.float32]

ERRORS, MOTION = slice(0, 6), slice(6, 12)
"""Columns of the observations: errors of angles and rates, then angles and rates."""


class Sensing:
    """Angles and rates of n plants as they are observed.

    Parameters
    ----------
    settings : Settings
    plants : int
    """

    def __init__(self, settings: Settings, plants: int) -> None:
        self.acts = bool(settings.angle_noise_rad or settings.rate_noise_rad_s or settings.delay_periods)
        self._deviation = np.repeat([settings.angle_noise_rad, settings.rate_noise_rad_s], 3)
        self._late = np.zeros((settings.delay_periods + 1, plants, 6), np.float32)
        self.generator = np.random.default_rng()

    def start(self, plants: NDArray[np.intp], observations: Array) -> None:
        """Begin episodes of some plants: their true observations (m, 15) become those of sensors."""
        self._late[:, plants] = observations[:, MOTION]
        self._observe(observations, observations[:, MOTION].copy())

    def observe(self, observations: Array) -> None:
        """Replace the true observations of all plants (n, 15) of a control period by those of the sensors."""
        self._late = np.roll(self._late, 1, axis=0)
        self._late[0] = observations[:, MOTION]
        self._observe(observations, self._late[-1])

    def _observe(self, observations: Array, motion: Array) -> None:
        reference = observations[:, MOTION] - observations[:, ERRORS]
        observed = motion + self._deviation * self.generator.standard_normal(motion.shape)
        observations[:, MOTION], observations[:, ERRORS] = observed, observed - reference
        np.clip(observations, -BOUNDS, BOUNDS, out=observations, casting="same_kind")
