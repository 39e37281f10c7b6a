"""Vector environment: many episodes in lockstep on one core, in the interface of Gymnasium."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from spheretwin.control.policy import BOUNDS
from spheretwin.envs.batch import EpisodeBatch
from spheretwin.envs.episode import (
    COMPLETED,
    REWARD_TERMS,
    RUNNING,
    STATUS,
    advance_episodes,
    motion_of,
    observe,
)
from spheretwin.models.base.arrays import Array, real_array
from spheretwin.models.base.compiled import for_types_of
from spheretwin.models.base.errors import InputError, shown
from spheretwin.plant.lanes import LANES
from spheretwin.plant.plants import Plants


class TwinVectorEnv(EpisodeBatch):
    """Many plants on one core, each in an episode of its own.

    Parameters
    ----------
    num_envs : int
        Number of plants; multiples of 16 use all lanes.
    task : str
        Name of a task, as in its id.
    autoreset_mode : AutoresetMode or str
        When an episode that has ended starts anew: with the next step, with the same, or not.
    **settings
        Fields of `Settings`.

    Attributes
    ----------
    settings : Settings
    reward_terms : tuple of str
        Names of the columns of ``infos["reward_terms"]``.

    Raises
    ------
    InputError
        A setting is unknown or out of range, or the scenario does not fit.
    """

    def __init__(
        self,
        num_envs: int = 1,
        task: str = "Track",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **settings: Any,
    ) -> None:
        super().__init__(num_envs, task, autoreset_mode, settings)
        self._plants = Plants(self._variants.parameters[0], num_envs)
        self._any_over = False
        self._begun, self._shown = np.arange(0), np.zeros((num_envs, len(BOUNDS)), np.float32)
        self._compile()

    def _compile(self) -> None:
        # Numba's check of the types of all arguments would take as long as the physics.
        self._advance = for_types_of(
            advance_episodes,
            self._plants.blocks,
            self._plants.magnetics,
            self._episodes,
            self._physics,
            np.empty((0, 0)),
            np.empty((0, 0), np.float32),
            np.empty(0),
            np.empty((0, 0)),
        )

    def __getstate__(self) -> dict[str, Any]:
        """Return what a pickle holds: everything but the compiled function."""
        return {name: value for name, value in vars(self).items() if name != "_advance"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what a pickle holds."""
        vars(self).update(state)
        self._compile()

    @property
    def q_rad(self) -> Array:
        """True hinge angles (n, 3), a copy."""
        return self._plants.q_rad

    def step(
        self, actions: Any
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Advance all episodes by a control period.

        Parameters
        ----------
        actions : (n, 3) or (n, groups) array
            Shares of the limit, from -1 to 1; beyond them they are cut.

        Returns
        -------
        observations, rewards, terminations, truncations, infos
            `infos` has ``reward_terms`` (n, 4) and, where an episode has ended, ``status``,
            ``max_error_rad`` and ``rms_error_rad``.

        Raises
        ------
        InputError
            Another shape of actions, or one that is not finite.
        """
        n, episodes = self.num_envs, self._episodes
        given, shape = real_array(actions), self.action_space.shape
        with np.errstate(over="ignore"):  # each is cut at the limit
            if given is None or given.shape != shape or not isfinite(given.sum()):
                raise InputError(
                    f"environment: expected finite actions of shape {shape}, received"
                    f" {shown(actions) if given is None or given.shape == shape else given.shape}"
                )
            actions = self._physics.limit * given
        over = episodes.code != RUNNING if self._any_over else np.zeros(n, np.bool_)
        observations = np.empty((n, len(BOUNDS)), np.float32)
        rewards, terms = np.empty(n), np.empty((n, len(REWARD_TERMS)))
        plants = self._plants
        ended = self._advance(
            plants.blocks,
            plants.magnetics,
            episodes,
            self._physics,
            np.ascontiguousarray(actions),
            observations,
            rewards,
            terms,
        )
        if self.sensing.acts:
            self.sensing.observe(observations)
        infos: dict[str, Any] = {"reward_terms": terms, "_reward_terms": np.ones(n, np.bool_)}
        self._shown = observations
        if not (ended or self._any_over):  # the usual case, in a fifth less time
            return observations, rewards, np.zeros(n, np.bool_), np.zeros(n, np.bool_), infos
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._start(np.flatnonzero(over))
            self._begin(observations)
        code = episodes.code
        truncations = code == COMPLETED
        terminations = (code != RUNNING) & ~truncations
        if ended:
            infos |= self._infos_of_end((code != RUNNING) & ~over)
            if self.autoreset_mode is AutoresetMode.SAME_STEP:
                self._restart(np.flatnonzero(code != RUNNING), observations, infos)
        self._any_over = bool(np.any(code != RUNNING))
        return observations, rewards, terminations, truncations, infos

    def _start(self, plants: NDArray[np.intp]) -> None:
        episodes, variants = self._episodes, self._variants
        chosen = self._draw(plants)
        for i, variant in zip(plants.tolist(), chosen.tolist(), strict=True):
            self._plants.set_parameters(i, variants.parameters[variant])
        self._plants.set_state(variants.q_rad[chosen], variants.qdot_rad_s[chosen], plants)
        for column in (episodes.tick, episodes.code, episodes.current, episodes.squares, episodes.largest):
            column[plants] = 0
        self._any_over, self._begun = bool(np.any(episodes.code != RUNNING)), plants

    def _restart(
        self, plants: NDArray[np.intp], observations: NDArray[np.float32], infos: dict[str, Any]
    ) -> None:
        """Start episodes in the step in which they ended; `infos` keeps their last observation."""
        final = np.full(self.num_envs, None, object)
        for i in plants:
            final[i] = observations[i].copy()
        mask = np.zeros(self.num_envs, np.bool_)
        mask[plants] = True
        infos |= {"final_obs": final, "_final_obs": mask}
        infos |= {
            "final_info": {key: infos[key] for key in list(infos) if "final" not in key},
            "_final_info": mask,
        }
        self._start(plants)
        self._begin(observations)

    def _begin(self, observations: NDArray[np.float32]) -> None:
        """Write the first observations of the plants that `_start` has started."""
        for i in self._begun.tolist():
            q, qdot = motion_of(self._plants.blocks[i // LANES], i % LANES)
            observe(q, qdot, i, self._episodes, observations[i])
        if self.sensing.acts and len(self._begun):
            first = observations[self._begun]
            self.sensing.start(self._begun, first)
            observations[self._begun] = first

    def _observations(self) -> NDArray[np.float32]:
        observations = self._shown.copy()
        self._begin(observations)
        self._shown = observations.copy()
        return observations

    def _infos_of_end(self, mask: NDArray[np.bool_]) -> dict[str, Any]:
        episodes = self._episodes
        status = np.full(self.num_envs, None, object)
        status[mask] = [STATUS[code] for code in episodes.code[mask]]
        rms = np.sqrt(episodes.squares / np.maximum(episodes.tick, 1))
        columns = {
            "status": status,
            "max_error_rad": np.where(mask, episodes.largest, 0.0),
            "rms_error_rad": np.where(mask, rms, 0.0),
        }
        return columns | {f"_{name}": mask.copy() for name in columns}
