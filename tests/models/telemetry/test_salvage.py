"""Parts joined to a file: all their rows, or those before a tear; nothing that is no part."""

import os

import pyarrow as pa
import pyarrow.parquet
import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry import partial_files as telemetry_parts
from spheretwin.models.telemetry.parquet import join
from spheretwin.models.telemetry.table import read_parquet
from tests.models.telemetry.streams import FACTS, GAIN, SIGNALS, parts_beside, streamed, table

pytestmark = pytest.mark.usefixtures("short_parts")


def test_parts_are_joined_under_the_first_one_s_facts(tmp_path):
    whole = table(200)
    file = streamed(path := tmp_path / "run.parquet", whole, 50)
    parts = parts_beside(path)
    joined = tmp_path / "joined.parquet"
    assert join(parts, joined) == 192
    again, metadata = read_parquet(joined)
    assert again.values.tobytes() == whole.rows(0, 192).values.tobytes()
    assert metadata == FACTS
    assert parts_beside(path) == parts  # whose they are may still be at work
    file.close({})
    assert sorted(os.listdir(tmp_path)) == ["joined.parquet", "run.parquet"]


def arrow_stream(path, arrow):
    with pa.OSFile(str(path), "wb") as sink, pa.ipc.new_stream(sink, arrow.schema) as stream:
        stream.write_table(arrow)


def columns(*values, kind=None, described=True):
    words = {"unit": "m", "meaning": "a length", "labels": ""} if described else None
    arrays = [pa.array(column, type=kind) for column in values]
    return pa.table(arrays, schema=pa.schema([pa.field("x", array.type, metadata=words) for array in arrays]))


FOREIGN = {
    "text": lambda path: path.write_text("no stream"),
    "like a stream": lambda path: path.write_bytes(b"\xff\xff\xff\xff\x08\0\0\0" + bytes(8)),
    "parquet": lambda path: pyarrow.parquet.write_table(table(10).arrow(FACTS), path),
    "missing": lambda path: None,
    "folder": lambda path: path.mkdir(),
    "no columns": lambda path: arrow_stream(path, pa.table({})),
    "undescribed": lambda path: arrow_stream(path, columns([1.0], described=False)),
    "whole numbers": lambda path: arrow_stream(path, columns([1])),
    "texts": lambda path: arrow_stream(path, columns([["a"]], kind=pa.list_(pa.string(), 1))),
    "vectors of any length": lambda path: arrow_stream(path, columns([[1.0], []])),
    "two of a name": lambda path: arrow_stream(path, columns([1.0], [1.0])),
}


@pytest.mark.parametrize("kind", FOREIGN)
@pytest.mark.parametrize("after_a_good_one", [False, True])
def test_an_invalid_part_is_refused(kind, after_a_good_one, tmp_path):
    foreign, good = tmp_path / "000001.arrows", tmp_path / "000000.arrows"
    FOREIGN[kind](foreign)
    arrow_stream(good, table(10).arrow(FACTS))
    before = sorted(os.listdir(tmp_path))
    with pytest.raises(InputError, match=rf"{foreign}.*expected an Arrow stream of a run"):
        join([good, foreign] if after_a_good_one else [foreign], tmp_path / "joined.parquet")
    assert sorted(os.listdir(tmp_path)) == before


def test_no_part_at_all_is_refused(tmp_path):
    with pytest.raises(InputError, match="at least one part"):
        join([], tmp_path / "joined.parquet")
    assert os.listdir(tmp_path) == []


# --- torn streams


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    """A table, the part that has it in three batches, and where each message of the part ends."""
    whole, ends = table(15, (*SIGNALS[:2], GAIN)), []
    parts = telemetry_parts.PartialStreams(tmp_path_factory.mktemp("stream") / "run.parquet", FACTS)
    for first in (0, 5, 10):
        parts.append(whole.rows(first, first + 5))
        ends.append(parts.paths[0].stat().st_size)  # it has reached the operating system
    parts.close()
    content = parts.paths[0].read_bytes()
    parts.remove()
    return whole, content, [8 + int.from_bytes(content[4:8], "little"), *ends]


@pytest.mark.release("cuts at every place for 1.6 s; test_interrupted_writing.py has a killed process")
def test_wherever_a_stream_is_torn_its_whole_batches_are_taken(stream, tmp_path):
    whole, content, ends = stream
    part, path = tmp_path / "000000.arrows", tmp_path / "joined.parquet"
    for size in range(ends[1], len(content) + 1):
        part.write_bytes(content[:size])
        rows = 5 * sum(size >= end for end in ends[1:])
        assert join([part], path) == rows
        again, metadata = read_parquet(path)
        assert again.values.tobytes() == whole.rows(0, rows).values.tobytes()
        assert metadata == FACTS


def test_a_stream_that_is_torn_before_it_has_a_whole_batch_is_refused(stream, tmp_path):
    _, content, ends = stream
    (part := tmp_path / "000000.arrows").touch()
    for size in [*range(0, ends[1], 7), ends[0] - 1, ends[0], ends[0] + 1, ends[1] - 1]:
        part.write_bytes(content[:size])
        with pytest.raises(InputError, match=rf"{part}.*expected a part with a whole batch of rows"):
            join([part], tmp_path / "joined.parquet")
    assert os.listdir(tmp_path) == ["000000.arrows"]


def test_wherever_the_last_part_is_torn_those_before_it_are_taken(stream, tmp_path):
    whole, content, ends = stream
    first, last, path = tmp_path / "000000.arrows", tmp_path / "000001.arrows", tmp_path / "joined.parquet"
    arrow_stream(first, (before := table(7)).arrow({"scenario": "the first"}))
    for size in (0, 3, 4, 7, 8, ends[0] - 1, ends[0], ends[0] + 1, ends[1] - 1, ends[1], ends[2] + 9):
        last.write_bytes(content[:size])
        rows = 5 * sum(size >= end for end in ends[1:])
        assert join([first, last], path) == 7 + rows
        again, metadata = read_parquet(path)
        assert metadata == {"scenario": "the first"}
        assert again["q_rad"][:7].tobytes() == before["q_rad"].tobytes()
        assert again["q_rad"][7:].tobytes() == whole["q_rad"][:rows].tobytes()
        assert (GAIN in again.signals) == (size >= ends[0])


def test_a_torn_part_before_the_last_is_refused(stream, tmp_path):
    _, content, ends = stream
    first, last = tmp_path / "000000.arrows", tmp_path / "000001.arrows"
    last.write_bytes(content)
    for size in (0, ends[0] - 1, ends[1] + 1):  # rows would be missing in the midst of the file
        first.write_bytes(content[:size])
        with pytest.raises(InputError, match=r"000000\.arrows: expected only the last part to be torn"):
            join([first, last], tmp_path / "joined.parquet")
    assert sorted(os.listdir(tmp_path)) == ["000000.arrows", "000001.arrows"]
