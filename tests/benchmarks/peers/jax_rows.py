"""Many rows in JAX: jitted and vmapped, in batches, one call after the other or one on each core."""

import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import jax
import numpy as np
from jax_laws import LAWS
from jax_loop import Figures, Trace, closed_loop
from problem import Problem

CORES = os.cpu_count() or 1


def trace(problem: Problem, rotor_kind) -> Trace:
    """Return one run as arrays."""
    row = _row(problem, rotor_kind, traced=True)
    trajectory = jax.jit(row)(problem.reference, problem.disturbance, problem.inertia)
    return Trace(*map(np.asarray, trajectory))


class Rows:
    """Rows of one law that differ in inertia and disturbance, compiled for batches of one size.

    If each core has its own batch, XLA uses one core for each; otherwise it may use all of them.
    """

    def __init__(self, problems: Sequence[Problem], rotor_kind, batch: int, on_each_core: bool) -> None:
        every = jax.vmap(_row(problems[0], rotor_kind), in_axes=(None, 0, 0))
        reference = jax.device_put(problems[0].reference)
        self._batches = [
            (
                reference,
                jax.device_put(np.stack([each.disturbance for each in part])),
                jax.device_put(np.stack([each.inertia for each in part])),
            )
            for part in (problems[first : first + batch] for first in range(0, len(problems), batch))
        ]
        options = {"xla_cpu_multi_thread_eigen": False} if on_each_core else None
        started = time.perf_counter()
        lowered = jax.jit(every).lower(*self._batches[0])
        self._compiled = lowered.compile(compiler_options=options)
        self.compile_s = time.perf_counter() - started
        self._threads = CORES if on_each_core else 1

    def __call__(self) -> Figures:
        with ThreadPoolExecutor(self._threads) as pool:
            parts = list(pool.map(self._one, self._batches))
        return Figures(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def _one(self, batch):
        return jax.block_until_ready(self._compiled(*batch))


def _row(problem: Problem, rotor_kind, traced: bool = False):
    law = LAWS[problem.scenario.controller.law](problem)
    return closed_loop(problem, law, rotor_kind(problem), traced)
