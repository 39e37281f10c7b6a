"""Vector environment: many episodes in lockstep, in the interface of Gymnasium."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, TypeGuard

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from spheretwin.envs.episode import (
    BOUNDS,
    COMPLETED,
    REWARD_TERMS,
    RUNNING,
    STATUS,
    Episodes,
    Physics,
    advance_episodes,
    observe,
)
from spheretwin.envs.settings import settings_of
from spheretwin.envs.variants import build_variants
from spheretwin.models.base.arrays import real_array
from spheretwin.models.base.compiled import for_types_of
from spheretwin.models.base.errors import InputError, shown
from spheretwin.plant.lanes import LANES
from spheretwin.plant.plants import Plants

Array = NDArray[np.float64]


class TwinVectorEnv(VectorEnv[Any, Any, Any]):
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

    reward_terms = REWARD_TERMS

    def __init__(
        self,
        num_envs: int = 1,
        task: str = "Track",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **settings: Any,
    ) -> None:
        if not num_envs >= 1:
            raise InputError(f"environment: expected at least one plant, received num_envs {num_envs}")
        self.settings = settings_of(task, settings)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {"autoreset_mode": self.autoreset_mode, "render_modes": []}
        self.num_envs = num_envs
        self._variants = variants = build_variants(self.settings)
        self._plants = Plants(variants.parameters[0], num_envs)
        by_current, groups = self.settings.actions == "current", self._plants.groups
        self._physics = Physics(
            step_s=self.settings.step_s,
            substeps=round(variants.period_s / self.settings.step_s),
            slows=any(np.any(one.coulomb_Nm) or np.any(one.viscous_Nm_s) for one in variants.parameters),
            by_current=by_current,
            limit=float(variants.lag["current_limit_A"][0]) if by_current else self.settings.torque_limit_Nm,
        )
        weights = self.settings.reward
        self._episodes = Episodes(
            tick=np.zeros(num_envs, np.int64),
            variant=np.zeros(num_envs, np.int64),
            code=np.full(num_envs, RUNNING),
            reference=variants.reference,
            disturbance=variants.disturbance,
            hinge_range=variants.hinge_range,
            weights=np.array([weights.tracking, weights.rate, weights.effort, weights.failure]),
            current=np.zeros((num_envs, groups)),
            mean_current=np.zeros((num_envs, groups)),
            lag=variants.lag,
            squares=np.zeros(num_envs),
            largest=np.zeros(num_envs),
        )
        self._any_over = False
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
        self._generators = [np.random.default_rng() for _ in range(num_envs)]
        bounds = BOUNDS.astype(np.float32)
        size = groups if by_current else 3
        self.single_observation_space = spaces.Box(-bounds, bounds, dtype=np.float32)
        self.single_action_space = spaces.Box(-1.0, 1.0, (size,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start episodes anew.

        Parameters
        ----------
        seed : int or sequence of int, optional
            Of each plant; a single one counts up from plant to plant.
        options : dict, optional
            ``reset_mask``, (n,) of bool: which plants; default: all.

        Raises
        ------
        InputError
            Unknown options, or another number of seeds than of plants.
        """
        if not isinstance(options, Mapping | None):
            raise InputError(f"environment: expected options as a table, received {shown(options)}")
        options = dict(options or {})
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, np.bool_)))
        if options or mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise InputError(
                f"environment: expected reset_mask of {self.num_envs} booleans, received {options or mask}"
            )
        if seed is not None:
            seeds = [seed + i for i in range(self.num_envs)] if _is_seed(seed) else seed
            if not (isinstance(seeds, Sequence) and all(one is None or _is_seed(one) for one in seeds)):
                raise InputError(
                    f"environment: expected whole numbers from 0 on as seeds, received {shown(seed)}"
                )
            if len(seeds) != self.num_envs:
                raise InputError(f"environment: expected {self.num_envs} seeds, received {len(seeds)}")
            for i, one in enumerate(seeds):
                if one is not None and mask[i]:
                    self._generators[i] = seeding.np_random(int(one))[0]
        self._start(np.flatnonzero(mask))
        return self._observations(), self._infos_of_start(mask)

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
        infos: dict[str, Any] = {"reward_terms": terms, "_reward_terms": np.ones(n, np.bool_)}
        if not (ended or self._any_over):  # the usual case, in a fifth less time
            return observations, rewards, np.zeros(n, np.bool_), np.zeros(n, np.bool_), infos
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._start(np.flatnonzero(over))
            self._observe(np.flatnonzero(over), observations)
        code = episodes.code
        truncations = code == COMPLETED
        terminations = (code != RUNNING) & ~truncations
        if ended:
            infos |= self._infos_of_end((code != RUNNING) & ~over)
            if self.autoreset_mode is AutoresetMode.SAME_STEP:
                self._restart(np.flatnonzero(code != RUNNING), observations, infos)
        self._any_over = bool(np.any(code != RUNNING))
        return observations, rewards, terminations, truncations, infos

    def share_generator(self, generator: np.random.Generator) -> None:
        """Draw the episodes of every plant from one generator."""
        self._generators = [generator] * self.num_envs

    def scenario_of(self, plant: int) -> Any:
        """Return the scenario of the present episode of a plant."""
        return self._variants.scenarios[self._episodes.variant[plant]]

    def _start(self, plants: NDArray[np.intp]) -> None:
        episodes, variants = self._episodes, self._variants
        for i in plants:
            variant = int(self._generators[i].integers(len(variants.scenarios)))
            episodes.variant[i] = variant
            self._plants.set_parameters(int(i), variants.parameters[variant])
        chosen = episodes.variant[plants]
        self._plants.set_state(variants.q_rad[chosen], variants.qdot_rad_s[chosen], plants)
        for column in (episodes.tick, episodes.code, episodes.current, episodes.squares, episodes.largest):
            column[plants] = 0
        self._any_over = bool(np.any(episodes.code != RUNNING))

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
        self._observe(plants, observations)

    def _observe(self, plants: NDArray[np.intp], observations: NDArray[np.float32]) -> None:
        for i in plants:
            observe(self._plants.blocks[i // LANES], i % LANES, i, self._episodes, observations[i])

    def _observations(self) -> NDArray[np.float32]:
        observations = np.empty((self.num_envs, len(BOUNDS)), np.float32)
        self._observe(np.arange(self.num_envs), observations)
        return observations

    def _infos_of_start(self, mask: NDArray[np.bool_]) -> dict[str, Any]:
        return {"variant": self._episodes.variant.copy(), "_variant": mask.copy()}

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


def _is_seed(value: object) -> TypeGuard[int]:
    return isinstance(value, int | np.integer) and bool(value >= 0)
