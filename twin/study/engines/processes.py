"""Processes of this machine, one a core: for rows with laws, metrics or trajectories in plain Python.

In threads one of them at a time would run. A thread of the driver hands batches to a process of its own and
waits for the results. The driver runs the rows whose telemetry is stored, as it belongs next to the journal.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Generator
from contextlib import suppress
from typing import Any, BinaryIO, NamedTuple

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.base.turns import outside_turn
from spheretwin.study.engines import threads, worker
from spheretwin.study.engines.engine import Batches, BatchResult, Engine, Order
from spheretwin.study.engines.worker import StudyJob
from spheretwin.study.grid import Row
from spheretwin.study.row import RowResult


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
    crew = _Crew(worker.job_of(order.work.rows))
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
            start = f"from {worker.__name__} import main; main()"
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
