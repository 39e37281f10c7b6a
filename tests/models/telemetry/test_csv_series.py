"""Series of the user's: read as spreadsheets write them, held or joined by lines, refused by line."""

import numpy as np
import pytest

from spheretwin.models.telemetry.csv_series import read

GOOD = "t_s,a,b\n0,1,-2\n0.5,3,4\n2,5,6e-1\n"
VALUES = [[1.0, -2.0], [3.0, 4.0], [5.0, 0.6]]


def reading(tmp_path, content, largest=100.0):
    path = tmp_path / "some.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read("bench", path, ("a", "b"), largest)


@pytest.mark.parametrize(
    "content",
    [
        GOOD,
        GOOD.replace("\n", "\r\n").replace(",", ", ").encode("utf-8-sig"),
        "b,where,a,t_s\n-2,x,1,0\n4,,3,0.5\n0.6,z,5,2",
    ],
)
def test_it_is_read_as_it_is_written(tmp_path, content):
    series = reading(tmp_path, content)
    np.testing.assert_array_equal(series.t_s, [0, 0.5, 2])
    np.testing.assert_array_equal(series.values, VALUES)
    assert series == reading(tmp_path, GOOD)
    assert hash(series) == hash(reading(tmp_path, GOOD))
    assert series != reading(tmp_path, GOOD.replace("3", "3.5"))
    assert series != GOOD
