"""Lines of comparisons are sent in chunks that lose no row and repeat none."""

import numpy as np
import pyarrow as pa
import pytest

from spheretwin.viz.comparison import ghosts
from tests.viz.comparison.compared import SIGNALS, T_s


class Sent:
    """Stands in for a stream: what is sent."""

    def __init__(self):
        self.rows, self.static = [], []

    def log(self, entity, *values, static):
        self.static.append((entity, values, static))

    def send_columns(self, entity, indexes, columns):
        (index,), (values,) = indexes, columns
        t_ns = np.asarray(index.as_arrow_array().cast(pa.int64()))
        self.rows.append((t_ns, np.asarray(values.as_arrow_array().flatten())))


@pytest.mark.parametrize("rows", [1, 999, 1000, 1001, 4000])
@pytest.mark.parametrize("name", SIGNALS)
def test_every_tick_is_sent_once(monkeypatch, name, rows):
    monkeypatch.setattr(ghosts, "MOST_ROWS", 1000)
    sent, values = Sent(), SIGNALS[name][:rows]
    ghosts.send_lines(sent, "run/compare/x", T_s[:rows], ghosts.Line("1 run", values, (1, 2, 3)))
    assert [len(t_ns) for t_ns, _ in sent.rows] == [1000] * (rows // 1000) + [rows % 1000] * (rows % 1000 > 0)
    np.testing.assert_array_equal(np.concatenate([t_ns for t_ns, _ in sent.rows]), np.round(T_s[:rows] * 1e9))
    np.testing.assert_array_equal(np.concatenate([drawn for _, drawn in sent.rows]), values)
