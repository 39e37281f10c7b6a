"""What the tests of studies share: short studies, and what their journals and tables hold."""

import errno
import os

import pyarrow.parquet as parquet

from spheretwin.study.runner import TELEMETRY, run
from spheretwin.study.study import made

SHORT = {"duration": 0.02}


def values(field, *listed, **others):
    return {"field": field, "kind": "values", "values": list(listed), **others}


def study(*axes, **others):
    """A study of runs of 20 ticks; `others` are its fields."""
    fields = {"name": "short", "scenario": "sinusoid", "fields": SHORT, "axis": list(axes), **others}
    return made(fields, "short")


LOADS = (
    values("disturbance.load", 0.0, 1.0, 2.0),
    {"field": "plant.modelling_error", "kind": "uniform", "low": 0.0, "high": 0.4},
)


def loads(**others):
    """24 rows: listed, drawn, two laws."""
    laws = [{"law": "pd"}, {"law": "afsm", "surface_slope": [60.0, 60.0, 60.0]}]
    return study(*LOADS, **{"samples": 4, "law": laws, **others})


def rows_of(folder):
    """Rows of a table, as dictionaries."""
    return parquet.read_table(folder / "table.parquet").to_pylist()


def run_rows(a_study, folder, **options):
    """Run a study; return the rows of its table."""
    run(a_study, folder, **{"threads": 1, **options})
    return rows_of(folder)


def table(folder):
    return (folder / "table.parquet").read_bytes()


def telemetry(folder):
    return sorted(path.name for path in (folder / TELEMETRY).iterdir())


class Full:
    """A file on a disk that takes so many bytes more."""

    def __init__(self, file, room):
        self._file, self._room = file, room

    def write(self, data):
        if self._room <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written = self._file.write(bytes(data)[: self._room])
        self._room -= written
        return written

    def __getattr__(self, name):
        return getattr(self._file, name)
