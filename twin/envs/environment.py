"""Environment of one plant, in the interface of Gymnasium."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from spheretwin.envs.vector import TwinVectorEnv


class TwinEnv(gymnasium.Env[Any, Any]):
    """One plant in an episode: the vector environment with a single plant.

    Parameters
    ----------
    task : str
        Name of a task, as in its id.
    **settings
        Fields of `Settings`.

    Raises
    ------
    InputError
        A setting is unknown or out of range, or the scenario does not fit.
    """

    def __init__(self, task: str = "Track", **settings: Any) -> None:
        self.metadata = {"render_modes": []}
        self.vector = TwinVectorEnv(1, task, AutoresetMode.DISABLED, **settings)
        self.observation_space = self.vector.single_observation_space
        self.action_space = self.vector.single_action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode; `options` has no entry."""
        super().reset(seed=seed)
        self.vector.share_generator(self.np_random)
        observations, infos = self.vector.reset(options=options)
        return observations[0], {"variant": int(infos["variant"][0])}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Advance by a control period.

        Parameters
        ----------
        action : (3,) or (groups,) array
            Shares of the limit, from -1 to 1; beyond them they are cut.

        Returns
        -------
        observation, reward, terminated, truncated, info
            `info` has ``reward_terms`` by name and, at the end, ``status``, ``max_error_rad`` and
            ``rms_error_rad``.
        """
        observations, rewards, terminations, truncations, infos = self.vector.step(np.asarray(action)[None])
        terms = zip(self.vector.reward_terms, infos["reward_terms"][0].tolist(), strict=True)
        info: dict[str, Any] = {"reward_terms": dict(terms)}
        if terminations[0] or truncations[0]:
            info |= {
                name: infos[name][0] for name in ("status", "max_error_rad", "rms_error_rad") if name in infos
            }
        return observations[0], float(rewards[0]), bool(terminations[0]), bool(truncations[0]), info
