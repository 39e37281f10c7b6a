"""Telemetry streamed to a file: the table of the run, in parts while it goes on."""

import os

import numpy as np
import pytest

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry import parquet as telemetry_file
from spheretwin.models.telemetry.checksums import write_parquet
from spheretwin.models.telemetry.parquet import TelemetryFile, join
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import PARQUET_FORMAT, read_parquet
from tests.models.telemetry.streams import FACTS, GAIN, PART_ROWS, SIGNALS, parts_beside, streamed, table

pytestmark = pytest.mark.usefixtures("short_parts")

SLIP = Signal("slip", "m", 1, "another law's own")


@pytest.mark.parametrize("rows", [0, 1, PART_ROWS - 1, PART_ROWS, PART_ROWS + 1, 5 * PART_ROWS, 333])
def test_the_file_is_the_table(rows, tmp_path):
    whole = table(rows)
    file = streamed(path := tmp_path / "run.parquet", whole, 7)
    file.finish("completed")
    assert not path.exists()
    file.close({"ticks": str(rows)})
    again, metadata = read_parquet(path)
    assert again.signals == SIGNALS
    assert again.values.tobytes() == whole.values.tobytes()
    assert metadata == {"scenario": '{"a": 1}', "ticks": str(rows), "status": "completed"}
    assert os.listdir(tmp_path) == ["run.parquet"]


@pytest.mark.parametrize("rows", [PART_ROWS - 1, 333, 1000])
def test_a_run_in_chunks_of_any_size_has_the_bytes_of_its_table(rows, tmp_path):
    whole, facts, files = table(rows), {"ticks": str(rows)}, set()
    arrow, group = whole.arrow(FACTS | facts), telemetry_file.GROUP_BATCHES * PART_ROWS
    groups = [arrow.slice(first, group) for first in range(0, rows, group)]
    write_parquet(expected := tmp_path / "expected.parquet", arrow.schema, groups, **PARQUET_FORMAT)
    for chunk in (1, 20, 63, 64, 65, 200, 333):
        streamed(path := tmp_path / "run.parquet", whole, chunk).close(facts)
        files.add(path.read_bytes())
    assert files == {expected.read_bytes()}
    if rows < PART_ROWS:
        whole.write_parquet(path, FACTS | facts)
        assert files == {path.read_bytes()}


def test_columns_that_come_and_go_are_nan_where_they_are_not(tmp_path):
    kinds = [(SIGNALS, 30), ((*SIGNALS, GAIN), 100), ((*SIGNALS, SLIP), 1), ((*SIGNALS, SLIP, GAIN), 70)]
    file = TelemetryFile(path := tmp_path / "run.parquet", SIGNALS, FACTS)
    pieces = [table(rows, signals, seed) for seed, (signals, rows) in enumerate(kinds)]
    for piece in pieces:
        for first in range(0, len(piece), 33):
            file.write(piece.rows(first, first + 33))
        file.write(piece.rows(0, 0))  # a chunk in which nothing was run
    file.close({})
    again, _ = read_parquet(path)
    assert again.signals == (*SIGNALS, GAIN, SLIP)
    assert os.listdir(tmp_path) == ["run.parquet"]
    ends = np.cumsum([len(piece) for piece in pieces])
    for piece, start, end in zip(pieces, [0, *ends], ends, strict=False):
        for sig in again.signals:
            result = again[sig.name][start:end]
            if sig in piece.signals:
                assert result.tobytes() == piece[sig.name].tobytes()
            else:
                assert np.all(np.isnan(result))


def test_two_meanings_of_one_column_are_refused_and_the_parts_remain(tmp_path):
    other = Signal("gain", "N", 1, "something else")
    file = TelemetryFile(path := tmp_path / "run.parquet", (*SIGNALS, GAIN), FACTS)
    file.write(table(20, (*SIGNALS, GAIN)))
    file.write(table(20, (*SIGNALS, other)))
    with pytest.raises(SpheretwinError) as caught:
        file.close({})
    assert "expected gain as 2 numbers in 1 (a law's own), received 1 in N" in str(caught.value)
    assert "40 rows are kept in" in str(caught.value)
    assert not path.exists()
    assert [join([part], tmp_path / "one.parquet") for part in parts_beside(path)] == [20, 20]


def test_a_link_stays_a_link_and_parts_lie_beside_the_file_itself(tmp_path):
    (elsewhere := tmp_path / "disk").mkdir()
    (link := tmp_path / "run.parquet").symlink_to("disk/real.parquet")
    whole = table(200)
    file = streamed(link, whole, 50)
    assert len(parts_beside(elsewhere / "real.parquet")) == 1
    assert sorted(os.listdir(tmp_path)) == ["disk", "run.parquet"]
    file.close({})
    assert link.is_symlink()
    assert os.listdir(elsewhere) == ["real.parquet"]
    assert read_parquet(link)[0].values.tobytes() == whole.values.tobytes()


def test_only_a_file_that_is_not_closed_can_be_recovered(tmp_path):
    """Parts of an open file are named with their rows; a closed file has none."""
    file = streamed(path := tmp_path / "run.parquet", table(2 * PART_ROWS), PART_ROWS)
    (part,) = parts_beside(path)
    assert file.partial() == (part.parent, path, 2 * PART_ROWS)
    file.close({})
    assert file.partial() is None
