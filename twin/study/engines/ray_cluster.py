"""Ray: rows in batches over all cores of a cluster, a process a core.

A process a core, and not threads within fewer: laws and metrics in plain Python run in all of them at a time.
Only numbers of rows travel to the nodes, and only results back, into the same journal. Files that a
study names must be on every node, under the same paths, and so must the same sources and versions: a node
that has others is refused by `spheretwin.study.engines.processes`. The driver runs the rows whose telemetry
is stored, as it belongs next to the journal.
"""

from __future__ import annotations

import contextlib
import logging
import os
import secrets
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Generator, Iterator
from typing import Any

from spheretwin.models.base.errors import InputError, SpheretwinError, shown, without_breaks
from spheretwin.models.base.extras import missing
from spheretwin.study.engines import processes, threads
from spheretwin.study.engines.engine import Batches, BatchResult, Engine, Order
from spheretwin.study.grid import Row
from spheretwin.study.row import RowResult

# No messages of Ray and no usage statistics.
QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # no warning about accelerators
}

# Ray uses 127.0.0.1 as its address and accepts only its own processes.
ALONE = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0", "RAY_AUTH_MODE": "token"}

PORT = 6379

OBJECTS_BYTES = 100_000_000
"""Object store of a local cluster: results are small, and are part of the messages."""

AHEAD = 2
"""Batches a core: one runs, one waits."""

HEARTBEAT_S = 1.0
"""Interval of the checks that the cluster is still there."""

MOST_SILENCES = 3
"""Consecutive checks without a cluster, or without a core in it, after which it is lost."""

REACH_S = 5.0

CONNECT_S = 60.0

# If the answer is not of a cluster, or of one with another address, Ray repeats its request for ever.
PROBE = "import ray, sys; ray.init(address=sys.argv[1], log_to_driver=False, configure_logging=False)"


def run(order: Order) -> Generator[tuple[Row, RowResult | None]]:
    """Yield the results of rows, each batch as it is finished.

    Raises
    ------
    InputError
        Ray is not installed, or there is no cluster at the address.
    SpheretwinError
        The cluster was lost, or a row repeatedly ended its process.
    """
    if order.rows == 0:
        return
    ray = _ray(local=order.address is None)
    here: list[int] = []
    with _connected(ray, order):
        yield from _Cluster(ray, order, here).results()
    yield from threads.run(order._replace(numbers=iter(here), rows=len(here)))


class _Cluster:
    """Driver: running batches and their results."""

    def __init__(self, ray: Any, order: Order, here: list[int]) -> None:
        self._ray, self._order = ray, order
        self._batches = Batches(order.elsewhere(here), order.rows)
        self._job = ray.put(processes.job_of(order.work.rows))
        # `Batches` counts and repeats lost batches; Ray itself repeats nothing.
        self._task = ray.remote(num_cpus=1, max_retries=0)(processes.run_batch)
        self._running: dict[Any, list[int]] = {}
        self._silences, self._checked_s = 0, time.monotonic()
        self._cores = self._most()
        context = ray.get_runtime_context()
        (ours,) = (node for node in ray.nodes() if node["NodeID"] == context.get_node_id())
        self._lifelines = (context.gcs_address, f"{ours['NodeManagerAddress']}:{ours['NodeManagerPort']}")

    def results(self) -> Iterator[tuple[Row, RowResult | None]]:
        while True:
            if not self._order.stop_requested():
                self._submit()
            if not self._running:
                return
            ready, _ = self._ray.wait(list(self._running), timeout=HEARTBEAT_S)
            if time.monotonic() - self._checked_s >= HEARTBEAT_S:
                self._check()
            for task in ready:
                yield from self._collect(task)

    def _submit(self) -> None:
        # A batch of one row may take long: no batch waits that an interruption would have to wait for.
        most = self._cores * (AHEAD if self._batches.rows > 1 else 1)
        while len(self._running) < max(most, 1):
            batch = self._batches.next(max(most, 1))
            if not batch:
                return
            self._running[self._task.remote(self._job, batch)] = batch

    def _collect(self, task: Any) -> Iterator[tuple[Row, RowResult | None]]:
        batch, errors = self._running.pop(task), self._ray.exceptions
        try:
            result: BatchResult = self._ray.get(task)
        except errors.RayTaskError as error:  # sources that differ too much to report it
            raise SpheretwinError(
                f"study {self._order.work.rows.study.name}: expected every node to run its rows,"
                f" received {type(error.cause).__name__}: {without_breaks(error.cause)}"
            ) from None
        except errors.RayError as error:  # node, process or memory is lost
            self._lose(batch, error)
            return
        self._batches.landed(len(batch), result.wall_s)
        yield from self._order.landed(result)

    def _lose(self, batch: list[int], error: Exception) -> None:
        self._cores = self._most()
        if not self._batches.lost(batch):
            raise SpheretwinError(
                f"study {self._order.work.rows.study.name}: expected row {batch[0]} to leave its process"
                f" alive, received {type(error).__name__} again and again; what is finished is kept"
            )

    def _check(self) -> None:
        """Check that head and own node are still there.

        Raises
        ------
        SpheretwinError
            One is lost. Ray itself would end this process some time later without a message.
        """
        self._checked_s = time.monotonic()
        is_there = all(map(_answers, self._lifelines))
        self._cores = self._most() if is_there else 0
        self._silences = 0 if self._cores else self._silences + 1
        if self._silences >= MOST_SILENCES:
            raise SpheretwinError(
                f"study {self._order.work.rows.study.name}: expected the cluster to stay,"
                f" received {'one without a core' if is_there else 'no answer from it any more'};"
                " what is finished is kept"
            )

    def _most(self) -> int:
        """Rows that may run at a time."""
        cores = int(self._ray.cluster_resources().get("CPU", 0))
        return min(cores, self._order.threads or cores)


def _ray(local: bool) -> Any:
    for name, value in (QUIET | ALONE if local else QUIET).items():
        os.environ.setdefault(name, value)
    if local:
        os.environ.setdefault("RAY_AUTH_TOKEN", secrets.token_hex(32))
    try:
        import ray
    except ImportError:
        raise missing("sweep", "Ray", "cluster", "for the engine ray") from None
    return ray


@contextlib.contextmanager
def _connected(ray: Any, order: Order) -> Iterator[None]:
    """Connect to the cluster at the address, or to one on this machine that ends with the sweep."""
    quiet = {"log_to_driver": False, "configure_logging": False}
    logging.getLogger("ray").setLevel(logging.CRITICAL)
    _silence(ray)
    if order.address is not None:
        _check_reachable(order.address)
    before = signal.getsignal(signal.SIGTERM)
    try:
        if order.address is None:
            ray.init(
                address="local",
                num_cpus=order.threads or os.cpu_count(),
                include_dashboard=False,
                object_store_memory=OBJECTS_BYTES,
                **quiet,
            )
        else:
            ray.init(address=order.address, **quiet)
    except Exception as error:  # exceptions of gRPC and sockets have no common base
        # None of our code runs here: no fault of ours is hidden.
        raise InputError(
            f"sweep: expected a Ray cluster {_where(order.address)}, received {without_breaks(error)}"
        ) from None
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, before)  # Ray replaces it
    try:
        yield
    finally:
        ray.shutdown()


def _silence(ray: Any) -> None:
    """Keep the messages of lost nodes off stdout, which contains the result of a sweep alone.

    ``log_to_driver=False`` silences the workers. Another thread of the driver prints the messages of a node
    that is lost, and Ray has no public switch for it. If Ray drops the internal one, a sweep still runs, but
    these messages appear between its results.
    """
    ray._private.worker._worker_logs_enabled = False


def _where(address: str | None) -> str:
    return "on this machine" if address is None else f"at {address}"


def _check_reachable(address: str) -> None:
    """Check the address within a minute; Ray itself may need many, or never end.

    Raises
    ------
    InputError
        There is no answer.
    """
    if "://" in address:
        raise InputError(
            "sweep: expected auto, HOST or HOST:PORT, of a cluster that this machine is a node of, as its"
            f" address, received {shown(address)}"
        )
    if address != "auto" and not _answers(address):
        raise InputError(f"sweep: expected a Ray cluster at {address}, received no answer")
    command = [sys.executable, "-c", PROBE, address]
    try:
        probe = subprocess.run(command, capture_output=True, text=True, timeout=CONNECT_S, check=False)
    except subprocess.TimeoutExpired:
        raise InputError(
            f"sweep: expected a Ray cluster at {address}, received an answer, but none of Ray's within"
            f" {CONNECT_S:g} s"
        ) from None
    if probe.returncode:
        last = (probe.stderr.strip().splitlines() or ["nothing"])[-1]
        raise InputError(f"sweep: expected a Ray cluster at {address}, received {last}")


def _answers(address: str) -> bool:
    host, _, port = address.rpartition(":") if ":" in address else (address, "", str(PORT))
    try:
        with socket.create_connection((host.strip("[]"), int(port)), timeout=REACH_S):
            return True
    except (OSError, ValueError, OverflowError):
        return False


ENGINE = Engine(run, takes_address=True)
