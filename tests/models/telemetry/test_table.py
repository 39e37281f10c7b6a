"""The table of a run: names, views, and a Parquet file that is whole or not there."""

import numpy as np
import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.checksums import write_parquet
from spheretwin.models.telemetry.signals import offsets
from spheretwin.models.telemetry.table import PARQUET_FORMAT, read_parquet
from tests.models.telemetry import streams
from tests.models.telemetry.streams import SIGNALS


@pytest.fixture
def table():
    return streams.table(20)


def test_a_table_has_the_names_of_its_columns_in_order(table):
    names = [signal.name for signal in SIGNALS]
    assert list(table) == list(table.keys()) == names
    assert np.array_equal(dict(table)["t_s"], table["t_s"])


def test_columns_are_views_by_name(table):
    assert table["t_s"].shape == (20,)
    assert table["current_A"].shape == (20, 18)
    table["q_rad"][2] = 7.0
    first = offsets(SIGNALS)["q_rad"]
    np.testing.assert_array_equal(table.values[2, first : first + 3], 7.0)
    np.testing.assert_array_equal(table.rows(2, 5)["q_rad"], table["q_rad"][2:5])


def test_another_reader_can_compare_the_checksums_of_pages(table, tmp_path):
    """They are Parquet's own. A flipped sign, stored without compression, is valid data without them."""
    import pyarrow.parquet

    arrow, path = table.arrow({}), tmp_path / "run.parquet"
    write_parquet(path, arrow.schema, [arrow], **{**PARQUET_FORMAT, "compression": "none"})
    column = pyarrow.parquet.ParquetFile(path).metadata.row_group(0).column(0)
    damaged = bytearray(path.read_bytes())
    damaged[column.data_page_offset + column.total_compressed_size - 1] ^= 0x80
    path.write_bytes(damaged)
    assert pyarrow.parquet.ParquetFile(path).read()["t_s"] != arrow["t_s"]
    with pytest.raises(OSError, match="CRC checksum verification failed"):
        pyarrow.parquet.ParquetFile(path, page_checksum_verification=True).read()


@pytest.mark.release("flips every byte for 2 s; test_damage.py has each kind of damage")
def test_every_byte_of_a_file_is_checked(table, tmp_path):
    """Magic, pages with their headers, footer, its length and its checksum."""
    table.write_parquet(path := tmp_path / "run.parquet", {"scenario": "{}"})
    content = path.read_bytes()
    for place in [*range(0, len(content) - 600, 7), *range(len(content) - 600, len(content))]:
        damaged = bytearray(content)
        damaged[place] ^= 1 << place % 8  # another bit of each byte
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"the file is damaged|expected a telemetry file"):
            read_parquet(path)


def test_a_column_that_is_there_twice_is_bad_input(table, tmp_path):
    import pyarrow as pa
    import pyarrow.parquet

    arrow = table.arrow({})
    again = pa.schema([*arrow.schema, arrow.schema.field("t_s")])
    twice = pa.Table.from_arrays([*arrow.columns, arrow["t_s"]], schema=again)
    pyarrow.parquet.write_table(twice, path := tmp_path / "twice.parquet")
    for rows in (True, False):
        with pytest.raises(InputError, match="expected each column once, received t_s twice"):
            read_parquet(path, rows=rows)


def test_a_table_has_no_name_of_another_format(table, tmp_path):
    for name in ("run.csv", "run.mat"):
        with pytest.raises(InputError, match=r"expected a name that ends in \.parquet"):
            table.write_parquet(tmp_path / name, {})
    assert not any(tmp_path.iterdir())
