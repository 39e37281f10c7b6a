"""Histories of past values."""

import numpy as np
import pytest

from spheretwin.models.base.history import push


@pytest.mark.parametrize("rows", [1, 2, 5])
def test_a_history_holds_the_last_values_newest_first(rows):
    history, values = np.zeros((rows, 2)), np.arange(1.0, 8.0)
    for value in values:
        push(history, 1, value)
    np.testing.assert_array_equal(history[:, 1], values[::-1][:rows])
    assert not history[:, 0].any()
