"""Vector environment on a GPU: an episode in each thread, with the functions of the processor."""

from __future__ import annotations

from functools import cache
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from spheretwin.control.policy import BOUNDS
from spheretwin.electronics.coil import advance_lag
from spheretwin.envs.batch import EpisodeBatch
from spheretwin.envs.episode import (
    COMPLETED,
    REWARD_TERMS,
    RUNNING,
    Episodes,
    Physics,
    finish,
    observe,
)
from spheretwin.models.base import cuda
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.record import Record, field
from spheretwin.models.kinematics import triple
from spheretwin.models.magnetics import SCRATCH_COLUMNS, Tables, TorqueModel
from spheretwin.plant.lanes import LaneMagnetics
from spheretwin.plant.plant_step import Parameters, advance
from spheretwin.plant.plants import Plants

REFUSED = -1
"""Code of an episode whose action is not finite."""


class DevicePlant(Record):
    """State of a plant of an environment, and working space."""

    q_rad: Array = field("hinge angles", "rad", 3, state=True)
    qdot_rad_s: Array = field("hinge rates", "rad/s", 3, state=True)
    current_A: Array = field("of each group", "A", "groups", state=True)
    mean_current_A: Array = field("over a physics step", "A", "groups")
    action: Array = field("torque on the hinges or currents of the groups", "N·m or A", "actions")
    load_Nm: Array = field("subtracted from the torque on the hinges", "N·m", 3)
    vectors: Array = field("working space of the step", "", (8, "groups"))
    G: Array = field("torque matrix", "N·m/A", (3, "groups"))
    scratch: Array = field("working space of the matrix", "", ("lines", SCRATCH_COLUMNS))


class Results(NamedTuple):
    """What a control period gives for each plant."""

    observations: NDArray[np.float32]  # (n, 15)
    rewards: Array  # (n,)
    terms: Array  # (n, 4)
    terminated: NDArray[np.bool_]  # (n,)
    truncated: NDArray[np.bool_]  # (n,)
    largest_rad: Array  # (n,) error
    rms_rad: Array  # (n,) error


class Tabled(NamedTuple):
    """Parameters of all variants."""

    each: Any
    """`Parameters` whose fields have a first index of the variant."""
    magnetics: LaneMagnetics
    """As that of `Plants`, with a plant for each variant."""


class CudaVectorEnv(EpisodeBatch):
    """Many plants on a GPU, each in an episode of its own.

    Observations, rewards, ends and terms of the reward are arrays on the GPU with
    ``__cuda_array_interface__``: PyTorch, CuPy and JAX take them without a copy. The next step overwrites
    them. Actions are such an array, an array with DLPack, or one of NumPy, of single or double precision. The
    processor reads a byte of each episode, and chooses what starts.

    Parameters and exceptions are those of `TwinVectorEnv`; an episode does not start in the step in which
    another one ends.
    """

    def __init__(
        self,
        num_envs: int = 1,
        task: str = "Track",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **settings: Any,
    ) -> None:
        cuda.check_gpu()
        super().__init__(num_envs, task, autoreset_mode, settings)
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            raise InputError(
                "environment: expected autoreset_mode NextStep or Disabled on a GPU, received SameStep"
            )
        if self.sensing.acts:
            raise InputError("environment: expected no noise and no delay on a GPU, received some")
        n, each = num_envs, self._variants.parameters
        sizes, actions = each[0].magnetics.sizes, self.action_width
        sizes = {"groups": sizes["groups"], "lines": sizes["lines"], "actions": actions}
        rows = DevicePlant.zeros(n, **sizes)
        numbers = rows.view(np.int64).reshape(n, -1)
        results = Results(
            np.zeros((n, len(BOUNDS)), np.float32),
            np.zeros(n),
            np.zeros((n, len(REWARD_TERMS))),
            np.zeros(n, np.bool_),
            np.zeros(n, np.bool_),
            np.zeros(n),
            np.zeros(n),
        )
        self._codes, self._choice = np.full(n, RUNNING, np.int8), np.full(n, -1, np.int32)
        starts = self._variants.q_rad, self._variants.qdot_rad_s
        tabled = _tabled(each)
        self._shared = cuda.on_device((numbers, tabled, self._episodes, self._choice, starts))
        self._results = cuda.on_device(results)
        self._advance, self._begin = (_kernel_of(body, rows.dtype) for body in (_advance_one, _start_one))

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Advance all episodes by a control period.

        Parameters
        ----------
        actions : (n, 3) or (n, groups) array
            Shares of the limit, from -1 to 1; beyond them they are cut.

        Returns
        -------
        observations, rewards, terminations, truncations, infos
            `infos` has ``reward_terms`` (n, 4), ``max_error_rad`` and ``rms_error_rad`` of the present
            episodes on the GPU, and ``code`` (n,) of NumPy: the place in `STATUS`.

        Raises
        ------
        InputError
            Another shape or type of actions, or one that is not finite: the episodes of the others have
            advanced.
        """
        given, shape = cuda.borrowed(actions), self.action_space.shape
        if given is None or given.shape != shape or given.dtype not in (np.float32, np.float64):
            raise InputError(
                f"environment: expected actions of shape {shape}, of single or double precision, received"
                f" {shown(actions) if given is None else f'{given.shape} of {given.dtype}'}"
            )
        over = np.flatnonzero(self._codes != RUNNING)
        cuda.launch(self._advance, self.num_envs, (*self._shared, self._physics, given, self._results))
        cuda.fetch(self._shared[2].code, self._codes)
        if np.any(self._codes == REFUSED):
            first = int(np.argmin(self._codes))
            raise InputError(f"environment: expected finite actions, received others for plant {first}")
        infos: dict[str, Any] = {
            "reward_terms": self._results.terms,
            "max_error_rad": self._results.largest_rad,
            "rms_error_rad": self._results.rms_rad,
            "code": self._codes.copy(),
        }
        if len(over) and self.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._start(over)
        results = self._results
        return results.observations, results.rewards, results.terminated, results.truncated, infos

    def _start(self, plants: NDArray[np.intp]) -> None:
        self._choice[:] = -1
        self._choice[plants] = self._draw(plants)
        cuda.send(self._choice, self._shared[3])
        cuda.launch(self._begin, self.num_envs, (*self._shared, self._results))
        self._codes[plants] = RUNNING

    def _observations(self) -> Any:
        return self._results.observations


@cache
def _kernel_of(body: Any, record: Any) -> Any:
    return cuda.kernel_of(body, record, 1)


def _tabled(each: tuple[Parameters, ...]) -> Tabled:
    columns: dict[str, Any] = {
        name: np.array([getattr(one, name) for one in each])
        for name in Parameters._fields
        if name not in ("joint", "magnetics")
    }
    joint, (first, *_) = np.concatenate([one.joint for one in each]), each
    return Tabled(Parameters(**columns, joint=joint, magnetics=first.magnetics), Plants(each).magnetics)


@inlined
def _parameters_of(tabled: Tabled, variant: int) -> Parameters:
    each, magnetics = tabled.each, tabled.magnetics
    table = magnetics.table_of[variant]
    tables = Tables(magnetics.curves[table], magnetics.fields[table])
    return Parameters(
        each.inertia_kg_m2[variant],
        each.weight_moment_Nm[variant],
        each.joint[variant : variant + 1],
        each.coulomb_Nm[variant],
        each.coulomb_asymmetry[variant],
        each.viscous_Nm_s[variant],
        each.friction_smoothing_rad_s[variant],
        each.constant_torque_Nm[variant],
        each.spring_Nm_rad[variant],
        each.torque_gain[variant],
        TorqueModel(magnetics.arrangement[variant : variant + 1], tables),
    )


def _advance_one(i: Any, plant: Any, unused: Any, arguments: Any) -> None:
    """Advance an episode by a control period, for `cuda.kernel_of`."""
    _, tabled, episodes, _, _, physics, actions, results = arguments
    count, limit = actions.shape[1], physics.limit
    for k in range(count):
        if not abs(actions[i, k]) < np.inf:
            episodes.code[i] = REFUSED
            return
        plant.action[k] = min(max(limit * actions[i, k], -limit), limit)
    if episodes.code[i] == RUNNING:
        _advance_plant(i, plant, tabled, episodes, physics)
    q, qdot = triple(plant.q_rad), triple(plant.qdot_rad_s)
    finish(q, qdot, i, episodes, plant.action, limit, results.rewards, results.terms[i])
    observe(q, qdot, i, episodes, results.observations[i])
    results.truncated[i] = episodes.code[i] == COMPLETED
    results.terminated[i] = episodes.code[i] != RUNNING and episodes.code[i] != COMPLETED
    results.largest_rad[i] = episodes.largest[i]
    results.rms_rad[i] = sqrt(episodes.squares[i] / max(episodes.tick[i], 1))


@allocation_free
def _advance_plant(i: int, plant: DevicePlant, tabled: Tabled, episodes: Episodes, physics: Physics) -> None:
    variant, tick = episodes.variant[i], episodes.tick[i]
    parameters = _parameters_of(tabled, variant)
    for k in range(3):
        plant.load_Nm[k] = episodes.disturbance[variant, tick, k]
        if not physics.by_current:
            plant.load_Nm[k] -= plant.action[k]
    for _ in range(physics.substeps):
        currents = plant.mean_current_A[:0]
        if physics.by_current:
            advance_lag(episodes.lag[0], plant.action, plant.current_A, plant.mean_current_A)
            currents = plant.mean_current_A[:]
        advance(
            plant.q_rad,
            plant.qdot_rad_s,
            currents,
            plant.load_Nm,
            parameters,
            physics.step_s,
            plant.vectors,
            plant.G,
            plant.scratch,
        )


def _start_one(i: Any, plant: Any, unused: Any, arguments: Any) -> None:
    """Start a new episode if one is chosen, for `cuda.kernel_of`."""
    _, _, episodes, choice, (q_rad, qdot_rad_s), results = arguments
    variant = choice[i]
    if variant < 0:
        return
    episodes.variant[i], episodes.tick[i], episodes.code[i] = variant, 0, RUNNING
    episodes.squares[i] = episodes.largest[i] = 0.0
    for k in range(3):
        plant.q_rad[k], plant.qdot_rad_s[k] = q_rad[variant, k], qdot_rad_s[variant, k]
    for j in range(plant.current_A.shape[0]):
        plant.current_A[j] = 0.0
    q, qdot = triple(plant.q_rad), triple(plant.qdot_rad_s)
    observe(q, qdot, i, episodes, results.observations[i])
    results.truncated[i] = results.terminated[i] = False
