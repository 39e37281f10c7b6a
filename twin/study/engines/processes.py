"""Processes of this machine, one a core: for rows with laws, metrics or trajectories in plain Python.

In threads one of them at a time would run. A thread of the driver hands batches to a process of its own and
waits for the results. The driver runs the rows whose telemetry is stored, as it belongs next to the journal.

A figure must not depend on the process. Each process first compares its sources, files and versions with
those of the driver, and runs no row if they differ.
"""

from __future__ import annotations

import os
import pickle
import platform
import subprocess
import sys
import threading
import time
from collections.abc import Generator
from contextlib import suppress
from functools import lru_cache
from typing import Any, BinaryIO, NamedTuple

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.models.base.turns import outside_turn
from spheretwin.study.engines import threads
from spheretwin.study.engines.engine import Batches, BatchResult, Engine, Order, Work
from spheretwin.study.grid import Grid, Row
from spheretwin.study.journal import provenance_of
from spheretwin.study.row import RowResult, Rows
from spheretwin.study.study import Study


class StudyJob(NamedTuple):
    """Study as text for other processes.

    Attributes
    ----------
    study : str
        JSON.
    folder : str
        Folder of the paths of the study.
    working_folder : str
        Folder of that folder.
    provenance : tuple of (str, str)
        Provenance of the driver: name, and digest or version.
    """

    study: str
    folder: str
    working_folder: str
    provenance: tuple[tuple[str, str], ...]


def job_of(rows: Rows) -> StudyJob:
    """Job of the study of the driver."""
    study = rows.study
    return StudyJob(
        study.model_dump_json(), study.folder, os.getcwd(), tuple(sorted(provenance_of(rows).items()))
    )


def run_batch(job: StudyJob, numbers: list[int]) -> BatchResult:
    """Run rows of a job by their numbers, up to the first fault."""
    try:
        grid, rows = _prepared(job)
    except SpheretwinError as error:
        return BatchResult([], [], str(error), 0.0)
    started = time.perf_counter()
    work = Work(rows)
    with timers_stopped():
        every = zip(numbers, work([grid[number] for number in numbers]), strict=True)
        results = [(number, result) for number, result in every if result is not None]
    fault = str(work.faults[0]) if work.faults else None
    return BatchResult(results, work.checked, fault, time.perf_counter() - started)


@lru_cache(maxsize=1)
def _prepared(job: StudyJob) -> tuple[Grid, Rows]:
    """Rows of a job in this process.

    Raises
    ------
    SpheretwinError
        A file is missing, or sources, files or versions differ from the driver's.
    """
    with suppress(OSError):  # without it its files are missing, which is reported
        os.chdir(job.working_folder)
    study = Study.model_validate_json(job.study).model_copy(update={"folder": job.folder})
    try:
        rows = Rows(study)
        ours = provenance_of(rows)
    except SpheretwinError as error:
        raise SpheretwinError(f"study {study.name}: node {platform.node()}: {error}") from None
    theirs = dict(job.provenance)
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
    """Return the differences; of digests only the names."""
    if name in ("study", "files", "sources"):
        return name
    return f"{name} ({ours.get(name, 'none')} for {theirs.get(name, 'none')})"


def _end_with(driver: int) -> None:
    """End this process once its driver has ended: user code that never returns would go on for ever."""
    while os.getppid() == driver:
        time.sleep(PARENT_S)
    os._exit(1)


PARENT_S = 0.5
"""Interval of the checks that the driver is still there."""


def main() -> None:
    """Run batches of a job from standard input, to standard output, until it ends.

    The argument of the process is the number of the process of its driver.
    """
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what user code prints is none of the results
    threading.Thread(target=_end_with, args=(int(sys.argv[1]),), daemon=True).start()
    job = pickle.load(sys.stdin.buffer)
    while True:
        try:
            numbers = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(run_batch(job, numbers), results)
        results.flush()


def run(order: Order) -> Generator[tuple[Row, RowResult | None]]:
    """Yield the rows of an order with their results, those of a batch as it is finished.

    Raises
    ------
    SpheretwinError
        A process has ended, or could not run the study.
    """
    count = order.threads or os.cpu_count() or 1
    here: list[int] = []
    batches = Batches(order.elsewhere(here), order.rows)
    crew = _Crew(job_of(order.work.rows))
    try:
        pending = iter(lambda: batches.next(count), [])
        for numbers, result in threads.run_each(pending, crew.run, count, order.stop_requested):
            batches.landed(len(numbers), result.wall_s)
            yield from order.landed(result)
    finally:
        crew.end()
    yield from threads.run(order._replace(numbers=iter(here), rows=len(here)))


class _Process(NamedTuple):
    program: subprocess.Popen[bytes]
    requests: BinaryIO
    results: BinaryIO


class _Crew:
    """Processes by the threads that use them.

    Parameters
    ----------
    job : StudyJob
    """

    def __init__(self, job: StudyJob) -> None:
        self._job, self._own = job, threading.local()
        self._all: list[_Process] = []

    def run(self, numbers: list[int]) -> BatchResult:
        """Return the results of a batch from the process of this thread.

        Raises
        ------
        SpheretwinError
            The process has ended.
        """
        with outside_turn:
            process = self._process()
            try:
                pickle.dump(numbers, process.requests)
                process.requests.flush()
                result: BatchResult = pickle.load(process.results)
            except (EOFError, OSError, pickle.UnpicklingError):
                raise SpheretwinError(
                    f"sweep: expected a process to finish rows {numbers[0]} to {numbers[-1]}, received its"
                    f" end with status {process.program.wait()}; what is finished is kept"
                ) from None
        return result

    def end(self) -> None:
        """End all processes; each one first finishes its batch."""
        for process in self._all:
            with suppress(OSError):
                process.requests.close()
        for process in self._all:
            process.program.wait()
            process.results.close()

    def _process(self) -> _Process:
        if not hasattr(self._own, "process"):
            start = f"from {__name__} import main; main()"
            command = [sys.executable, "-P", "-c", start, str(os.getpid())]
            # Of a session of its own: an interruption of the driver lets it finish its batch.
            program: Any = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )
            process = self._own.process = _Process(program, program.stdin, program.stdout)
            self._all.append(process)
            pickle.dump(self._job, process.requests)
        own: _Process = self._own.process
        return own


ENGINE = Engine(run)
