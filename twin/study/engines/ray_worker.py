"""What a process of a cluster does: it makes the study's rows from its configuration, once, and runs batches.

A figure must not depend on where its row was run. So a process first holds what its results would stand on
against what the driver's stand on, and runs no row where the two differ.
"""

from __future__ import annotations

import os
import platform
import time
from contextlib import suppress
from functools import lru_cache
from typing import NamedTuple

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.study.engines.engine import Work
from spheretwin.study.grid import Grid
from spheretwin.study.journal import basis_of
from spheretwin.study.row import Result, Rows
from spheretwin.study.study import Study


class Job(NamedTuple):
    """A study as it travels: nothing of it but text.

    Attributes
    ----------
    study : str
        JSON.
    folder : str
        Where the study's paths are taken from.
    working_folder : str
        Where this folder in turn is taken from.
    basis : tuple of (str, str)
        What the driver's results stand on: name, and digest or version.
    """

    study: str
    folder: str
    working_folder: str
    basis: tuple[tuple[str, str], ...]


class Landed(NamedTuple):
    """What came of a batch.

    Attributes
    ----------
    results : list of (int, Result)
        By the row's number, those that were finished.
    checked : list of int
        Rows that were run on both plants.
    fault : str, optional
        Why the study has to stop.
    wall_s : float
        What the rows took.
    """

    results: list[tuple[int, Result]]
    checked: list[int]
    fault: str | None
    wall_s: float


def job_of(rows: Rows) -> Job:
    """Job of a study, as the driver has it."""
    study = rows.study
    return Job(study.model_dump_json(), study.folder, os.getcwd(), tuple(sorted(basis_of(rows).items())))


def run_batch(job: Job, numbers: list[int]) -> Landed:
    """Run rows of a job by their numbers, up to the first fault."""
    try:
        grid, rows = _prepared(job)
    except SpheretwinError as error:
        return Landed([], [], str(error), 0.0)
    started = time.perf_counter()
    work, results = Work(rows), []
    with timers_stopped():
        for number in numbers:
            result = work(grid[number])
            if result is None:
                break
            results.append((number, result))
    fault = str(work.faults[0]) if work.faults else None
    return Landed(results, work.checked, fault, time.perf_counter() - started)


@lru_cache(maxsize=1)
def _prepared(job: Job) -> tuple[Grid, Rows]:
    """Rows of a job in this process.

    Raises
    ------
    SpheretwinError
        A file is not here, or they would stand on something else than the driver's.
    """
    with suppress(
        OSError
    ):  # where it is not, files that are named from it are not either, which will be told
        os.chdir(job.working_folder)
    study = Study.model_validate_json(job.study).model_copy(update={"folder": job.folder})
    try:
        rows = Rows(study)
        ours = basis_of(rows)
    except SpheretwinError as error:
        raise SpheretwinError(f"study {study.name}: node {platform.node()}: {error}") from None
    theirs = dict(job.basis)
    if apart := [
        _difference_text(name, ours, theirs)
        for name in sorted({*ours, *theirs})
        if _differ(name, ours, theirs)
    ]:
        raise SpheretwinError(
            f"study {study.name}: expected node {platform.node()} to have the driver's sources, files and"
            f" versions, received other {', '.join(apart)}; none of its rows was taken"
        )
    return Grid(study), rows


def _differ(name: str, ours: dict[str, str], theirs: dict[str, str]) -> bool:
    return ours.get(name) != theirs.get(name)


def _difference_text(name: str, ours: dict[str, str], theirs: dict[str, str]) -> str:
    """What differs: by name alone where it is a digest, which says nothing to anyone."""
    if name in ("study", "files", "sources"):
        return name
    return f"{name} ({ours.get(name, 'none')} for {theirs.get(name, 'none')})"
