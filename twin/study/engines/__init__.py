"""Engines of a sweep: on what its rows run, one file each, and their list."""

from spheretwin.study.engines import cuda, processes, ray_cluster, threads
from spheretwin.study.engines.engine import Engine

ENGINES: dict[str, Engine] = {
    "local": threads.ENGINE,
    "processes": processes.ENGINE,
    "cuda": cuda.ENGINE,
    "ray": ray_cluster.ENGINE,
}
