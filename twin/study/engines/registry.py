"""All engines of a sweep by name: a new one is a file and a row."""

from spheretwin.twin.study.engines import cluster, local
from spheretwin.twin.study.engines.engine import Engine

ENGINES: dict[str, Engine] = {
    "local": local.ENGINE,
    "ray": cluster.ENGINE,
}
