"""Data and layouts of a recording, as a viewer reads them."""

import warnings

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import RrdReader

from spheretwin.viz.layout.view import TIMELINE


def reader(path):
    """Reader of a file; what a live view sends has no footer."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rr.error_utils.RerunWarning)
        return RrdReader(path)


def columns(path, store=None, **of):
    """Values of every component, by entity and component, and times in ns by entity and component."""
    values, times = {}, {}
    stream = reader(path).stream(store=store)
    for chunk in stream.filter(**of) if of else stream:
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name == TIMELINE or name.startswith("rerun.controls"):
                continue
            key = chunk.entity_path, name
            values.setdefault(key, []).append(batch.column(name))
            if TIMELINE in batch.schema.names:
                times.setdefault(key, []).append(np.asarray(batch.column(TIMELINE).cast(pa.int64())))
    return values, times


def series(read, entity, component, field=None):
    """Times in ns and values (n, size) of a component of columns that were read, in the order of time."""
    values, times = (of[f"/{entity.removeprefix('/')}", component] for of in read)
    parts = [column.flatten().field(field) if field else column for column in values]
    t_ns = np.concatenate(times)
    order = np.argsort(t_ns, kind="stable")
    return t_ns[order], np.concatenate([np.asarray(part.flatten()).reshape(len(part), -1) for part in parts])[
        order
    ]


def layouts(path):
    """Values of every component of the layouts of a recording, a brief one of its beginning first."""
    stores = [columns(path, store)[0] for store in RrdReader(path).blueprints()]
    return [
        {key: [value for column in parts for value in column.to_pylist()] for key, parts in store.items()}
        for store in sorted(stores, key=len)
    ]
