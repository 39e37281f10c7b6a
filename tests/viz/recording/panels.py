"""What the panels of a recording draw, read from its layout and its data, as a viewer reads them."""

import warnings
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import RrdReader

from spheretwin.viz.layout.view import TIMELINE


class PanelLine(NamedTuple):
    """One visualizer of a panel."""

    entity: str
    component: str
    name: str
    """Field of the component."""
    visualizer: str


class Panel(NamedTuple):
    """Plot over time."""

    title: str
    band: tuple | None
    shown: list | None
    """Which entries of each line are visible; None for all."""
    entities: list
    lines: list


def columns(path, store=None):
    """Values of every component, by entity and component, and times in ns by entity and component."""
    values, times = {}, {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rr.error_utils.RerunWarning)  # what a live view sends has no footer
        reader = RrdReader(path)
    for chunk in reader.stream(store=store):
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name == TIMELINE or name.startswith("rerun.controls"):
                continue
            key = chunk.entity_path, name
            values.setdefault(key, []).append(batch.column(name))
            if TIMELINE in batch.schema.names:
                times.setdefault(key, []).append(np.asarray(batch.column(TIMELINE).cast(pa.int64())))
    return values, times


def rows(path, entity, component, field):
    """Times in ns and values (n, size) of one field of a component, in the order of time."""
    values, times = columns(path)
    key = f"/{entity.removeprefix('/')}", component
    columned = []
    for column in values[key]:
        inner = column.flatten().field(field)
        columned.append(np.asarray(inner.flatten()).reshape(len(column), -1))
    t_ns, whole = np.concatenate(times[key]), np.concatenate(columned)
    order = np.argsort(t_ns, kind="stable")
    return t_ns[order], whole[order]


def layouts(path):
    """Values of every component of the layouts of a recording, a brief one of its beginning first."""
    stores = [columns(path, store)[0] for store in RrdReader(path).blueprints()]
    return [
        {key: [value for column in parts for value in column.to_pylist()] for key, parts in store.items()}
        for store in sorted(stores, key=len)
    ]


def panels(path):
    """Plots of the last layout of a recording."""
    *_, layout = layouts(path)
    results = []
    for (view, name), values in layout.items():
        if name != "ViewBlueprint:class_identifier" or values[-1] != ["TimeSeries"]:
            continue
        entities = (layout.get((f"{view}/ViewContents", "ViewContents:query")) or [[]])[-1]
        lines = [
            _panel_line(
                entity.partition("/overrides/")[2].partition("/visualizers")[0], values[-1], layout, entity
            )
            for (entity, component), values in layout.items()
            if entity.startswith(f"{view}/ViewContents/overrides/")
            and component == "VisualizerInstruction:component_map"
        ]
        results.append(
            Panel(
                (layout.get((view, "ViewBlueprint:display_name")) or [[""]])[-1][0],
                (layout.get((f"{view}/ScalarAxis", "ScalarAxis:range")) or [[None]])[-1][0],
                (layout.get((f"{view}/defaults", "SeriesLines:visible_series")) or [None])[-1],
                entities,
                lines,
            )
        )
    return results


def _panel_line(entity, mappings, layout, path):
    by_target = {mapping["target"]: mapping for mapping in mappings}
    scalars = by_target["Scalars:scalars"]
    kind = (layout.get((path, "VisualizerInstruction:visualizer_type")) or [[""]])[-1][0]
    return PanelLine(
        entity, scalars["source_component"], scalars["selector"].removeprefix(".").removesuffix("[]"), kind
    )
