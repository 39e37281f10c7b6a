"""Environment of one plant, in the interface of Gymnasium."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from spheretwin.envs.picture import Camera
from spheretwin.envs.vector import TwinVectorEnv
from spheretwin.models.base.errors import InputError, shown

RGB = "rgb_array"
RENDERING: dict[str, Any] = {"render_modes": [RGB], "render_fps": 1000}
"""What Gymnasium asks the class before it makes an environment; each one has the rate of its own period."""


class TwinEnv(gymnasium.Env[Any, Any]):
    """One plant in an episode: the vector environment with a single plant.

    Parameters
    ----------
    task : str
        Name of a task, as in its id.
    render_mode : str, optional
        ``rgb_array``: `render` returns pictures, which MuJoCo draws with OpenGL.
    **settings
        Fields of `Settings`.

    Raises
    ------
    InputError
        A setting is unknown or out of range, or the scenario does not fit.
    """

    metadata = RENDERING

    def __init__(self, task: str = "Track", render_mode: str | None = None, **settings: Any) -> None:
        if render_mode not in (None, RGB):
            raise InputError(f"environment: expected render_mode {RGB}, received {shown(render_mode)}")
        self.vector = TwinVectorEnv(1, task, AutoresetMode.DISABLED, **settings)
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": round(1 / self.vector.period_s)}
        self._camera: Camera | None = None
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

    def render(self) -> Any:
        """Return a picture of the actuator (480, 480, 3) with `render_mode` ``rgb_array``, otherwise None.

        Raises
        ------
        InputError
            OpenGL is missing.
        """
        if self.render_mode is None:
            return None
        self._camera = self._camera or Camera(self.vector.scenario_of(0).plant.mjcf)
        return self._camera.image(self.vector.q_rad[0])

    def close(self) -> None:
        """Free what pictures need."""
        if self._camera:
            self._camera.close()
        self._camera = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what a pickle holds: everything but the camera, which is made again."""
        return vars(self) | {"_camera": None}

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
