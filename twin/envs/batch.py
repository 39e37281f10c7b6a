"""Batch of episodes in the interface of Gymnasium: settings, spaces, seeds and variants, for every device."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, TypeGuard

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from spheretwin.control.policy import BOUNDS
from spheretwin.envs.episode import REWARD_TERMS, RUNNING, Episodes, Physics
from spheretwin.envs.sensing import Sensing
from spheretwin.envs.settings import settings_of
from spheretwin.envs.variants import build_variants
from spheretwin.models.base.errors import InputError, shown


class EpisodeBatch(VectorEnv[Any, Any, Any]):
    """Many plants, each in an episode of its own; what computes them is of the subclass.

    Parameters and exceptions are those of `TwinVectorEnv`.
    """

    reward_terms = REWARD_TERMS

    def __init__(
        self, num_envs: int, task: str, autoreset_mode: AutoresetMode | str, settings: Mapping[str, Any]
    ) -> None:
        if not num_envs >= 1:
            raise InputError(f"environment: expected at least one plant, received num_envs {num_envs}")
        self.settings = settings_of(task, settings)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.num_envs = num_envs
        self._variants = variants = build_variants(self.settings)
        self.metadata = {"autoreset_mode": self.autoreset_mode, "render_modes": []}
        self.sensing = Sensing(self.settings, num_envs)
        by_current, groups = self.settings.actions == "current", variants.parameters[0].torque_gain.size
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
            code=np.full(num_envs, RUNNING, np.int8),
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
        self._generators = [np.random.default_rng() for _ in range(num_envs)]
        bounds = BOUNDS.astype(np.float32)
        size = groups if by_current else 3
        self.single_observation_space = spaces.Box(-bounds, bounds, dtype=np.float32)
        self.action_width = size
        self.single_action_space = spaces.Box(-1.0, 1.0, (size,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
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
                    if i == 0:
                        self.sensing.generator = self._generators[0].spawn(1)[0]
        self._start(np.flatnonzero(mask))
        infos = {"variant": self._episodes.variant.copy(), "_variant": mask.copy()}
        return self._observations(), infos

    def share_generator(self, generator: np.random.Generator) -> None:
        """Draw the episodes of every plant, and all noise, from one generator."""
        self._generators = [generator] * self.num_envs
        self.sensing.generator = generator

    @property
    def period_s(self) -> float:
        """Control period, one step."""
        return self._variants.period_s

    def scenario_of(self, plant: int) -> Any:
        """Return the scenario of the present episode of a plant."""
        return self._variants.scenarios[self._episodes.variant[plant]]

    def _draw(self, plants: NDArray[np.intp]) -> NDArray[np.int64]:
        """Draw the variants of the next episodes of some plants."""
        variants = self._episodes.variant
        for i in plants:
            variants[i] = self._generators[i].integers(len(self._variants.scenarios))
        return variants[plants]

    @abstractmethod
    def _start(self, plants: NDArray[np.intp]) -> None:
        """Start new episodes of some plants."""

    @abstractmethod
    def _observations(self) -> Any:
        """Return the observations of all plants."""


def _is_seed(value: object) -> TypeGuard[int]:
    return isinstance(value, int | np.integer) and bool(value >= 0)
