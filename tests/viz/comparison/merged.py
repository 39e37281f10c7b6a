"""Content of a merged recording."""

import numpy as np
import pyarrow as pa
from rerun.chunk import RrdReader

from spheretwin.viz.layout.view import TIMELINE


class Merged:
    """Entities of a merged recording, its numbers by entity and field, and its text."""

    def __init__(self, path):
        self.path, self.entities, self.columns, self.text = path, set(), {}, ""
        for chunk in RrdReader(path).stream():
            self.entities.add(chunk.entity_path)
            batch = chunk.to_record_batch()
            if "Scalars:scalars" in batch.schema.names:
                self._add(batch, chunk.entity_path, batch.column("Scalars:scalars"))
            if "values_0" in batch.schema.names:
                rows = batch.column("values_0").flatten()
                for field in rows.type:
                    self._add(batch, f"{chunk.entity_path}:{field.name}", rows.field(field.name))
            if chunk.entity_path == "/runs" and "TextDocument:text" in batch.schema.names:
                ((self.text,),) = batch.column("TextDocument:text").to_pylist()

    def _add(self, batch, name, column):
        t_ns = np.asarray(batch.column(TIMELINE).cast(pa.int64()))
        values = np.asarray(column.flatten()).reshape(len(t_ns), -1)
        self.columns.setdefault(name, []).append((t_ns, values))

    def values(self, entity):
        return np.concatenate([values for _, values in sorted(self.columns[entity], key=lambda c: c[0][0])])

    def t_ns(self, entity):
        return np.concatenate([t_ns for t_ns, _ in sorted(self.columns[entity], key=lambda c: c[0][0])])
