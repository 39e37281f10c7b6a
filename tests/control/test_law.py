"""A law, its numbers and its signals as the loop can take them, and what is none."""

import numpy as np
import pytest

from spheretwin.control.law import Law
from spheretwin.models.telemetry.signals import Signal


def step(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0


def law(**changes):
    return Law(**{"name": "mine", "step": step, "parameters": [1.0], "state": np.zeros(3), **changes})


@pytest.mark.parametrize("field", ["parameters", "state"])
def test_numbers_are_copied_as_compiled_code_takes_them(field):
    mine = np.arange(6.0)[::2]
    copy = getattr(law(**{field: mine}), field)
    mine[:] = -1.0
    np.testing.assert_array_equal(copy, [0, 2, 4])
    assert copy.flags.c_contiguous
    assert copy.dtype == np.float64


@pytest.mark.parametrize(
    "numbers",
    [[1, 2.5], (1, 2), [], np.array([1, 2], dtype=np.int8), np.array([0.5], dtype=np.float32), [True, 2]],
)
def test_plain_numbers_are_taken(numbers):
    np.testing.assert_array_equal(law(parameters=numbers).parameters, np.array(numbers, dtype=float))


def test_lists_become_tuples():
    gain = Signal("gain", "1", 2, "", ["a", "b"])
    assert gain == Signal("gain", "1", 2, "", ("a", "b"))
    assert hash(gain) == hash(Signal("gain", "1", 2, "", ("a", "b")))
    assert law(signals=[gain]).signals == (gain,)
