"""Feed of the page's script: its messages, decoded as the script decodes them, have the bench's numbers."""

import json

import numpy as np
import pytest

from spheretwin.viz.bench.feed import MOST_SELECTED, Feed
from tests.viz.bench import fake


def decoded(raw):
    """Return the header and the columns by name, as the script reads them."""
    length = int.from_bytes(raw[:4], "little")
    assert (4 + length) % 8 == 0  # numbers of 8 bytes are aligned
    header = json.loads(raw[4 : 4 + length])
    numbers = np.frombuffer(raw[4 + length :], dtype="<f8").reshape(-1, max(header["count"], 1))
    columns = {key: numbers[2 + 2 * place : 4 + 2 * place] for place, key in enumerate(header["columns"])}
    if header["count"]:
        columns |= {"number": numbers[0], "t_s": numbers[1]}
    return header, columns


@pytest.fixture
def feed():
    bench = fake.Bench()
    return Feed(bench, lambda: {"mode": "hold"}), bench


def test_a_new_page_gets_all_bins_and_what_is_fixed(feed):
    feed, bench = feed
    header, columns = decoded(feed.data({"groups": "4,2,99"}))
    assert (header["mode"], header["run"], header["count"]) == ("hold", 1, 50)
    coils = np.array(header["fixed"]["coils"])
    np.testing.assert_allclose(coils / np.linalg.norm(coils, axis=1)[:, None], bench.actuator.coil_axes)
    bins = bench.bins()
    np.testing.assert_array_equal(columns["number"], bins.numbers)
    np.testing.assert_array_equal(columns["t_s"], bins.rows["t_s"][:, 0])
    for axis in range(3):
        for key, name, factor in (
            ("q", "q_rad", 180 / np.pi),
            ("ref", "q_ref_rad", 180 / np.pi),
            ("error", "error_rad", 1e3),
            ("torque", "torque_command_Nm", 1.0),
        ):
            low, high = columns[f"{key}{axis}"]
            np.testing.assert_allclose(low, factor * bins.low[name][:, axis], rtol=1e-14)
            np.testing.assert_allclose(high, factor * bins.high[name][:, axis], rtol=1e-14)
    np.testing.assert_array_equal(columns["current4"][1], bins.high["current_A"][:, 4])
    np.testing.assert_array_equal(columns["currents"][1], bins.high["current_A"].max(axis=1))
    assert {"current2", "current99"} & set(columns) == {"current2"}
    assert np.isnan(columns["temperature"]).all()


def test_a_page_gets_the_bins_since_its_last_one(feed):
    feed, bench = feed
    header, columns = decoded(feed.data({"run": "1", "after": "47"}))
    assert columns["number"].tolist() == [48.0, 49.0]
    assert "fixed" not in header
    assert decoded(feed.data({"run": "1", "after": "60"}))[0]["count"] == 0
    bench.run = 2  # another run has begun
    header, columns = decoded(feed.data({"run": "1", "after": "60"}))
    assert (header["run"], header["count"], "fixed" in header) == (2, 50, True)


@pytest.mark.parametrize(
    "query",
    [{"after": "x"}, {"run": "-1", "after": "9" * 400}, {"groups": "a,,-3,²"}, {"groups": "7," * 999}],
)
def test_a_query_of_another_form_is_a_new_page(feed, query):
    header, _ = decoded(feed[0].data(query))
    assert header["count"] == 50
    assert len([key for key in header["columns"] if key.startswith("current")]) <= 1 + MOST_SELECTED


def test_a_capture_has_every_row(feed):
    feed, bench = feed
    assert decoded(feed.capture({}))[0]["count"] == 0
    bench.capture, bench.now.capture_t_s = bench.bins().rows, 0.5
    header, columns = decoded(feed.capture({"groups": "3"}))
    assert (header["count"], header["event_s"]) == (50, 0.5)
    np.testing.assert_array_equal(*columns["current3"])
    np.testing.assert_array_equal(columns["error1"][0], 1e3 * bench.capture["error_rad"][:, 1])
