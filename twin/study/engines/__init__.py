"""Engines of a sweep: on what its rows run, one file each, and their list."""

from spheretwin.models.base.errors import InputError
from spheretwin.study.engines import cuda, processes, ray_cluster, threads
from spheretwin.study.engines.engine import Engine

ENGINES: dict[str, Engine] = {
    "local": threads.ENGINE,
    "processes": processes.ENGINE,
    "cuda": cuda.ENGINE,
    "ray": ray_cluster.ENGINE,
}


def engine_in_process(name: str, work: str) -> Engine:
    """Return an engine whose blocks run in threads of this process, by its name.

    Raises
    ------
    InputError
        There is no such engine; the message begins with the kind of `work`.
    """
    able = {other: engine for other, engine in ENGINES.items() if engine.in_process}
    if name not in able:
        raise InputError(f"{work}: expected engine {' or '.join(able)}, received {name}")
    return able[name]
