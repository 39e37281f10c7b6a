"""Adapter of the vector environment to Stable-Baselines3, which does not know that of Gymnasium."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

from spheretwin.envs.vector import TwinVectorEnv

Indices = None | int | Iterable[int]


class StableBaselinesEnv(VecEnv):
    """Vector environment for Stable-Baselines3.

    The info of an episode's last step has ``terminal_observation``, ``TimeLimit.truncated``, ``status``,
    ``max_error_rad`` and ``rms_error_rad``.

    Parameters
    ----------
    num_envs : int
        Number of plants.
    task : str
        Name of a task.
    **settings
        Fields of `Settings`.

    Raises
    ------
    InputError
        A setting is unknown or out of range, or the scenario does not fit.
    """

    def __init__(self, num_envs: int, task: str = "Track", **settings: Any) -> None:
        self.vector = TwinVectorEnv(num_envs, task, AutoresetMode.SAME_STEP, **settings)
        self._actions: Any = None
        super().__init__(num_envs, self.vector.single_observation_space, self.vector.single_action_space)

    def reset(self) -> Any:
        """Start all episodes; return the observations."""
        seeds = None if all(seed is None for seed in self._seeds) else self._seeds
        observations, _ = self.vector.reset(seed=seeds)
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: Any) -> None:
        """Set the actions (n, size) of the next control period."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Advance by a control period; return observations, rewards, dones and infos."""
        observations, rewards, terminations, truncations, infos = self.vector.step(self._actions)
        each: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        dones = terminations | truncations
        for i in np.flatnonzero(dones):
            figures = {
                name: infos["final_info"][name][i] for name in ("status", "max_error_rad", "rms_error_rad")
            }
            each[i] = {
                "terminal_observation": infos["final_obs"][i],
                "TimeLimit.truncated": bool(truncations[i] and not terminations[i]),
                **figures,
            }
        return observations, rewards.astype(np.float32), dones, each

    def close(self) -> None:
        """Close the environment."""
        self.vector.close()

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return an attribute of the environment, once for each plant."""
        return [getattr(self.vector, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set an attribute of the environment, which all plants share."""
        setattr(self.vector, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the environment with the number of each plant as its first argument."""
        method = getattr(self.vector, method_name)
        return [method(i, *method_args, **method_kwargs) for i in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: Indices = None) -> list[bool]:
        """Return False for each plant: none has a wrapper."""
        return [False for _ in self._get_indices(indices)]
