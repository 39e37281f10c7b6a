"""A Rerun recording as text: every component of every entity with its data, and the layout view by view."""

import json
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import RrdReader

from spheretwin.viz.layout.view import TIMELINE
from tests.content.values import array, tree, words

Columns = dict[str, dict[str, list]]
"""Rows by entity and component: times in ns (None if static), row ids, values as Arrow."""


def recording_text(path: Path, scenario: bool = False) -> str:
    """Return all that a recording holds, the scenario on request; identities and checksums are omitted."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rr.error_utils.RerunWarning)  # a live stream has no footer
        reader = RrdReader(path)
    out = []
    for entity, components in sorted(_columns(reader.stream()).items()):
        if entity.endswith("/scenario") and not scenario:
            out.append(f"{entity} {' '.join(sorted(components))}")
            continue
        out.append(entity)
        times = ""
        for component, rows in sorted(components.items()):
            for line in _component(component, rows):
                # Components that were sent together have the same times.
                before, at, rest = line.partition(" at ")
                mine, separator, values = rest.partition(" s: ")
                if at and separator and mine == times:
                    line = f"{before} at the same times: {values}"
                elif at and separator:
                    times = mine
                out.append(f"  {line}")
    # The order of the layouts in a file has no meaning.
    results = ["\n".join(_layout(reader.stream(store=store))) for store in reader.blueprints()]
    for place, text in enumerate(sorted(results)):
        out += [f"layout {place}", text]
    return "\n".join(out)


def _columns(stream) -> Columns:
    result: Columns = {}
    for chunk in stream:
        batch = chunk.to_record_batch()
        rows = [bytes(row) for row in batch.column("rerun.controls.RowId").to_pylist()]
        timed = TIMELINE in batch.schema.names
        times = batch.column(TIMELINE).cast(pa.int64()).to_pylist() if timed else [None] * len(batch)
        for name in batch.schema.names:
            if name in (TIMELINE, "blueprint") or name.startswith("rerun.controls"):
                continue
            by_component = result.setdefault(chunk.entity_path, {})
            by_component.setdefault(name, []).append((times, rows, batch.column(name)))
    return result


def _component(name: str, parts: list) -> Iterator[str]:
    """Lines of one component: times, and values in the order of time and of logging."""
    timed = [part for part in parts if part[0][0] is not None]
    for kind, of_kind in (("static", [part for part in parts if part not in timed]), ("", timed)):
        if not of_kind:
            continue
        times = np.array([0 if each is None else each for part in of_kind for each in part[0]])
        ids = [each for part in of_kind for each in part[1]]
        order = sorted(range(len(ids)), key=lambda place: (times[place], ids[place]))
        column = pa.concat_arrays([part[2] for part in of_kind]).take(pa.array(order))
        times = times[order]
        head = f"{name} {kind}".rstrip()
        if not kind:
            head += f" at {array(times * 1e-9)} s"
        if "checksum" in name or name in ("RecordingInfo:start_time", "total"):
            yield head
        else:
            lines = list(_values(column))
            if len(lines) == 1:
                yield f"{head}: {lines[0]}"
            else:
                yield f"{head}:"
                yield from (f"  {line}" for line in lines)


def _values(column: pa.Array) -> Iterator[str]:
    while pa.types.is_list(column.type) and pa.types.is_struct(column.type.value_type):
        column = column.flatten()
    if pa.types.is_struct(column.type):
        for field in column.type:
            lines = list(_values(column.field(field.name)))
            if all(len(line) < 200 for line in lines) and len(lines) <= 4:
                yield f"{field.name} {', '.join(lines)}"
            else:
                yield from (f"{field.name} {line}" for line in lines)
        return
    inner = column.type
    while pa.types.is_nested(inner) and not (pa.types.is_struct(inner) or pa.types.is_union(inner)):
        inner = inner.value_type
    if pa.types.is_string(inner):
        yield from _texts(column)
    elif pa.types.is_union(inner):  # numbers of a tensor
        yield _numbers(pa.array(column.to_pylist()))
    elif pa.types.is_struct(inner):
        yield from words(list(map(repr, column.to_pylist()))).splitlines()
    else:
        yield _numbers(column)


def _numbers(column: pa.Array) -> str:
    """Numbers of all rows, as a matrix if every row has as many."""
    lengths = {len(row) for row in _rows(column)} if len(column) <= 1000 else set()
    leaves = column
    while pa.types.is_nested(leaves.type):
        leaves = leaves.flatten()
    values = np.asarray(leaves.to_numpy(zero_copy_only=False))
    if values.dtype == object:  # truth values, or empty entries
        values = np.array([np.nan if value is None else float(value) for value in values])
    if values.dtype == bool:
        values = values.astype(int)
    size = values.size // len(column) if len(column) else 0
    whole = size > 1 and len(column) > 1 and values.size == size * len(column) and len(lengths) <= 1
    return array(values.reshape(len(column), size)) if whole else f"rows={len(column)} {array(values)}"


def _rows(column: pa.Array) -> list:
    return [row if isinstance(row, list) else [row] for row in column.to_pylist()] if len(column) else []


def _texts(column: pa.Array) -> Iterator[str]:
    leaves = column
    while pa.types.is_nested(leaves.type):
        leaves = leaves.flatten()
    texts = leaves.to_pylist()
    if len(texts) == 1 and texts[0][:1] in ("{", "["):
        yield from tree(json.loads(texts[0]))
    elif len(texts) == 1 and ("\n" in texts[0] or len(texts[0]) > 200):
        yield from (repr(line) for line in texts[0].splitlines())
    elif sum(map(len, texts)) > 60 * len(texts) and len(texts) <= 60:
        yield f"{len(texts)} texts"
        yield from map(repr, texts)
    else:
        yield words(texts)


# Layout -----------------------------------------------------------------------------------------------------


def _layout(stream) -> Iterator[str]:
    """Lines of a layout: containers and views from the root, then the panels; identities are omitted."""
    last: dict[str, dict[str, object]] = {}
    for entity, components in _columns(stream).items():
        for component, parts in components.items():
            rows = [(row, value) for _, ids, column in parts for row, value in zip(ids, column, strict=True)]
            last.setdefault(entity, {})[component] = max(rows, key=lambda row: row[0])[1].as_py()
    viewport = last.pop("/viewport", {})
    root = viewport.pop("ViewportBlueprint:root_container", [None])[0]
    seen: set[str] = set()
    if root is not None:
        yield from _container(f"/container/{_uuid(root)}", last, seen, 1)
    yield f"  viewport {viewport}"
    for entity in sorted(last):
        if not entity.startswith(("/view/", "/container/")):
            yield f"  {entity} {_shown(last[entity])}"
    unused = [entity for entity in last if entity.startswith(("/view/", "/container/"))]
    unused = [entity for entity in unused if "/".join(entity.split("/")[:3]) not in seen]
    yield f"  {len(unused)} entities of no container"


def _uuid(raw: list[int]) -> str:
    text = bytes(raw).hex()
    return "-".join((text[:8], text[8:12], text[12:16], text[16:20], text[20:]))


def _container(path: str, last: dict, seen: set[str], depth: int) -> Iterator[str]:
    seen.add(path)
    fields = {name.partition(":")[2]: value for name, value in last[path].items()}
    contents = [f"/{child.lstrip('/')}" for child in fields.pop("contents", None) or []]
    if active := fields.pop("active_tab", None):
        fields["active_tab"] = [contents.index(f"/{active[0].lstrip('/')}")]
    yield f"{'  ' * depth}container {_shown(fields)}"
    for child in contents:
        if child.startswith("/container/"):
            yield from _container(child, last, seen, depth + 1)
        else:
            yield from _view(child, last, seen, depth + 1)


def _view(path: str, last: dict, seen: set[str], depth: int) -> Iterator[str]:
    seen.add(path)
    space = "  " * depth
    fields = {name.partition(":")[2]: value for name, value in last[path].items()}
    yield f"{space}view {_shown(fields)}"
    below = {entity: last[entity] for entity in last if entity.startswith(f"{path}/")}
    order = {}
    for components in below.values():
        for place, raw in enumerate(components.get("ActiveVisualizers:instruction_ids") or []):
            order[_uuid(raw)] = f"visualizer {place}"
    lines = []
    for entity, components in below.items():
        name = entity.removeprefix(f"{path}/")
        for uuid, text in order.items():
            name = name.replace(uuid, text)
        rest = {key: value for key, value in components.items() if "instruction_ids" not in key}
        if rest:
            lines.append(f"{space}  {name} {_shown(rest)}")
    yield from sorted(lines)


def _shown(fields: dict) -> str:
    """Components by name; a list of one entry as the entry, a long list of numbers by its figures."""
    parts = []
    for name, value in sorted(fields.items()):
        if name == "VisualizerInstruction:component_map":
            sources = [f"{row['source_component']}{row['selector'] or ''}" for row in value]
            targets = [f"{row['target']} {row['source_kind']}" for row in value]
            parts += [f"{target} = {source}" for target, source in zip(targets, sources, strict=True)]
            continue
        if (
            isinstance(value, list)
            and len(value) > 6
            and all(isinstance(each, int | float) for each in value)
        ):
            value = array(np.array(value, dtype=float if not isinstance(value[0], bool) else int))
        elif isinstance(value, list) and len(value) == 1:
            value = value[0]
        parts.append(f"{name} {value!r}")
    return ", ".join(parts)
