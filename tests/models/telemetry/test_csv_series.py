"""Series of the user's: read as spreadsheets write them, held or joined by lines, refused by line."""

import numpy as np
import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.csv_series import TimeSeries, check_rising, read

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
        "# of the bench\n# twice\n" + GOOD.replace("0.5,", "# between\n\n0.5,"),
        GOOD.replace("\n", "\r\n").replace(",", ", ").encode("utf-8-sig"),
        "b,where,a,t_s\n-2,x,1,0\n4,,3,0.5\n0.6,z,5,2",
        '"t_s","a","b"\n"0","1","-2"\n0.5,3,4\n2,5,0.6',
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


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("", "expected each of the columns t_s, a, b once, received none"),
        ("# nothing\n", "received none"),
        ("t_s;a;b\n0;1;2\n", "received t_s;a;b"),
        ("t_s,a\n0,1\n", "columns t_s, a, b once, received t_s, a"),
        ("t_s,a,b,a\n0,1,2,3\n", "once, received t_s, a, b, a"),
        ("t_s,a,b\n", "expected at least one row below the header, received none"),
        (GOOD + "3,4\n", "expected 3 numbers in line 5, received 2"),
        (GOOD + "3,4,5,6\n", "expected 3 numbers in line 5, received 4"),
        (GOOD + "\n# so\n3,north,5\n", "line 7: expected a number from -100 to 100 as a, received 'north'"),
        (GOOD + "3,,5\n", "line 5: expected a number from -100 to 100 as a, received ''"),
        (GOOD + "3,nan,5\n", "line 5: expected a number from -100 to 100 as a, received 'nan'"),
        (GOOD + "3,4,-inf\n", "as b, received '-inf'"),
        (GOOD + "3,4,100.5\n", "as b, received '100.5'"),
        (GOOD + "1e10,4,5\n", "line 5: expected a number from -1e+09 to 1e+09 as t_s, received '1e10'"),
        (GOOD + "1,4,5\n", "line 5: expected a t_s that rises, received 2 then 1"),
        (GOOD + "2.0000000001,4,5\n", "line 5: expected a t_s that rises, received 2 then 2.0000000001"),
        (b"t_s,a,b\n0,1,\xff\n", "expected a readable CSV file"),
        ("t_s,a,b\n0,1," + "9" * 200_000 + "\n", "expected values between commas, field larger than"),
    ],
)
def test_an_invalid_series_is_refused_by_line(tmp_path, content, complaint):
    with pytest.raises(InputError) as refusal:
        reading(tmp_path, content)
    message = str(refusal.value)
    assert message.startswith(f"bench {tmp_path / 'some.csv'}: ")
    assert complaint in message
    assert "\n" not in message


@pytest.mark.parametrize("name", ["absent.csv", ".", "a\0b"])
def test_an_unreadable_file_is_refused(tmp_path, name):
    with pytest.raises(InputError, match="expected a readable CSV file"):
        read("bench", tmp_path / name, ("a", "b"), 1.0)


def test_values_hold_or_are_joined_by_lines():
    series = TimeSeries(np.array([1.0, 2.0, 4.0]), np.array([[1.0, 10.0], [3.0, 20.0], [7.0, 0.0]]))
    t = np.array([0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 9.0])
    steps = series.zero_order_hold(t, (-1.0, -2.0))
    np.testing.assert_array_equal(steps[:, 0], [-1, 1, 1, 3, 3, 7, 7])
    np.testing.assert_array_equal(steps[:, 1], [-2, 10, 10, 20, 20, 0, 0])
    linear = series.interpolate(t)
    np.testing.assert_array_equal(linear[:, 0], [1, 1, 2, 3, 5, 7, 7])
    np.testing.assert_array_equal(linear[:, 1], [10, 10, 15, 20, 10, 0, 0])


def test_times_must_rise():
    check_rising((0.0, 1.0, 1.5))
    check_rising((3.0,))
    with pytest.raises(ValueError, match=r"rising times, received 1 then 0\.5 s"):
        check_rising((0.0, 1.0, 0.5))
